#include "sysid/math/banded.hpp"

#include <algorithm>
#include <stdexcept>

namespace sysid {

namespace {

constexpr double kNothing = 1e-12;  // of a square

/// Largest distance of two entries of a row.
std::size_t width_of(const SparseRows& rows, std::size_t size) {
    const std::size_t entries = std::min(rows.columns.size(), rows.values.size());
    std::size_t width = 0;
    for (std::size_t k = 0; k + 1 < rows.pointers.size(); ++k) {
        const std::int32_t begin = rows.pointers[k];
        const std::int32_t end = rows.pointers[k + 1];
        if (begin < 0 || end < begin || static_cast<std::size_t>(end) > entries)
            throw std::invalid_argument("pointers: expected places of entries, in order");
        if (begin == end) continue;
        const auto [low, high] =
            std::minmax_element(rows.columns.begin() + begin, rows.columns.begin() + end);
        if (*low < 0 || static_cast<std::size_t>(*high) >= size)
            throw std::invalid_argument("columns: expected columns of the matrix");
        width = std::max(width, static_cast<std::size_t>(*high - *low));
    }
    return width;
}

}  // namespace

LowerBand gram(const SparseRows& rows, std::size_t size) {
    LowerBand band{width_of(rows, size), {}};
    const std::size_t step = band.width + 1;
    // The product of both may be more than a whole number holds, and then look small.
    if (size > band.entries.max_size() / step)
        throw std::invalid_argument("size: expected columns that fit into memory");
    band.entries.assign(size * step, 0.0);
    double* const entries = band.entries.data();
    for (std::size_t k = 0; k + 1 < rows.pointers.size(); ++k) {
        const std::int32_t begin = rows.pointers[k];
        for (std::int32_t a = begin; a < rows.pointers[k + 1]; ++a) {
            const auto one = static_cast<std::size_t>(rows.columns[a]);
            const double value = rows.values[a];
            entries[one * step] += value * value;
            for (std::int32_t b = begin; b < a; ++b) {
                const auto other = static_cast<std::size_t>(rows.columns[b]);
                const auto [j, i] = std::minmax(one, other);
                const double both = value * rows.values[b];
                entries[j * step + i - j] += i == j ? 2.0 * both : both;
            }
        }
    }
    return band;
}

std::vector<double> squares(std::span<const double> factor, std::size_t size,
                            const SparseRows& rows) {
    width_of(rows, size);
    if (size == 0 || factor.empty() || factor.size() % size != 0)
        throw std::invalid_argument("factor: expected a column for each unknown");
    const std::size_t step = factor.size() / size;
    for (std::size_t j = 0; j < size; ++j)
        if (factor[j * step] == 0.0) throw std::invalid_argument("factor: it is singular");
    std::vector<double> found;
    found.reserve(rows.pointers.size());
    std::vector<double> left(size + step, 0.0);  // what a factor's last columns reach beyond it
    for (std::size_t k = 0; k + 1 < rows.pointers.size(); ++k) {
        std::size_t first = size;
        std::size_t last = 0;
        for (std::int32_t e = rows.pointers[k]; e < rows.pointers[k + 1]; ++e) {
            const auto column = static_cast<std::size_t>(rows.columns[e]);
            left[column] += rows.values[e];
            first = std::min(first, column);
            last = std::max(last, column);
        }
        double sum = 0.0;
        double since = 0.0;  // the row ended, or a width of the band ago
        std::size_t j = first;
        for (std::size_t more = 0; j < size; ++j) {
            const double* const column = factor.data() + j * step;
            const double x = left[j] / column[0];
            sum += x * x;
            for (std::size_t i = 1; i < step; ++i) left[j + i] -= x * column[i];
            if (j <= last) continue;
            // What it makes of a row dies away: once a width adds nothing, nothing does.
            since += x * x;
            if (++more < step) continue;
            if (since <= kNothing * sum) break;
            more = 0;
            since = 0.0;
        }
        std::fill(left.begin() + static_cast<std::ptrdiff_t>(first),
                  left.begin() + static_cast<std::ptrdiff_t>(std::min(j, size - 1) + step), 0.0);
        found.push_back(sum);
    }
    return found;
}

}  // namespace sysid
