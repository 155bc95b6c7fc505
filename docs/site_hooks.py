"""Pages of the site that are made of other files: notebooks, and texts beside the code."""

import ast
import base64
import json
import logging
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

REPO = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((REPO / "notebooks").glob("*.ipynb"))
# Files of the tree that are pages of the site.
PAGES = {
    "CHANGELOG.md": "changelog.md",
    **{
        path.relative_to(REPO).as_posix(): f"benchmarks/{path.parent.name}.md"
        for path in sorted(REPO.glob("benchmarks/*/README.md"))
    },
    **{f"notebooks/{path.name}": f"tutorials/{path.stem}.md" for path in NOTEBOOKS},
}
# Modules whose public names the reference holds, beside the package itself and its errors.
MODULES = ["manoeuvres", "estimate", "compare", "diagnose", "identify", "study"]
MODULES += ["export", "sensors", "lab", "online", "twin", "published"]
log = logging.getLogger("mkdocs.hooks.site")  # warnings there count where the build is strict
PICTURES = {"image/png": "png", "image/gif": "gif", "image/svg+xml": "svg", "image/jpeg": "jpg"}
LINK = re.compile(r"(?<=\]\()([^)#:\s]+)(#[^)\s]*)?(?=\))")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made of other files."""
    for source, page in PAGES.items():
        if source.endswith(".ipynb"):
            continue
        text = (REPO / source).read_text("utf-8")
        files.append(File.generated(config, page, content=text))
    for path in NOTEBOOKS:
        pictures: dict[str, bytes] = {}
        text = "\n\n".join(notebook_parts(json.loads(path.read_text("utf-8")), path.stem, pictures))
        files.append(File.generated(config, f"tutorials/{path.stem}.md", content=text))
        for name, data in pictures.items():
            files.append(File.generated(config, f"tutorials/{name}", content=data))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Point links to files of the tree at the pages that show them, or name the file alone."""
    here = next(
        (s for s, p in PAGES.items() if p == page.file.src_uri), f"docs/{page.file.src_uri}"
    )

    def target(link: re.Match[str]) -> str:
        path = (REPO / here).parent.joinpath(link[1]).resolve()
        if not path.is_relative_to(REPO):
            return link[0]
        name = path.relative_to(REPO).as_posix()
        shown = PAGES.get(name) or name.removeprefix("docs/")
        if files.get_file_from_path(shown) is None:
            return link[0]
        up = "../" * page.file.src_uri.count("/")
        return f"{up}{shown}{link[2] or ''}"

    return LINK.sub(target, markdown)


def notebook_parts(book: dict[str, Any], name: str, pictures: dict[str, bytes]) -> Iterator[str]:
    """Markdown of the cells of a notebook; pictures are put aside."""
    for cell in book["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            yield source
            continue
        yield f"```python\n{source}\n```"
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            kind = next((k for k in PICTURES if k in data), None)
            if output["output_type"] == "stream":
                yield printed("".join(output["text"]))
            elif kind:
                file = f"{name}_{len(pictures)}.{PICTURES[kind]}"
                content = "".join(data[kind])
                pictures[file] = content.encode() if "svg" in kind else base64.b64decode(content)
                yield f"![output of the cell above]({file})"
            elif "text/html" in data:
                yield f'<div class="output">\n{"".join(data["text/html"])}\n</div>'
            elif "text/plain" in data:
                yield printed("".join(data["text/plain"]))


def printed(text: str) -> str:
    """A block of printed lines."""
    text = re.sub(r"\x1b\[[0-9;]*m", "", text).rstrip()
    return f'<div class="nboutput" markdown>\n\n````text\n{text}\n````\n\n</div>'


def on_post_build(config: MkDocsConfig) -> None:
    """Warn of public names that the reference leaves out."""
    pages = sorted((Path(config.site_dir) / "reference").glob("*.html"))
    anchors = {
        a for p in pages for a in re.findall(r'id="(sysid_vehicle[\w.]*)"', p.read_text("utf-8"))
    }
    shown = {a.rpartition(".")[2] for a in anchors}
    package = REPO / "python/sysid_vehicle"
    files = [package / "__init__.py", package / "errors.py"]
    for file in [*files, *(package / name / "__init__.py" for name in MODULES)]:
        for name in public_names(file.read_text("utf-8")):
            if name not in shown and name not in {*MODULES, "__version__", "excitation"}:
                log.warning(f"reference: {file.relative_to(package)} exports {name}, shown nowhere")


def public_names(text: str) -> list[str]:
    """Names in the `__all__` of a module."""
    for node in ast.parse(text).body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
            names: list[str] = ast.literal_eval(node.value)
            return names
    return []
