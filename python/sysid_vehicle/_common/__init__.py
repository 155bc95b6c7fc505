"""What every station uses: arguments, files, progress, printed text."""
