// Information matrices whose unknowns are coupled to their neighbours alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace sysid {

/// Sparse rows, one after the other: the k-th has the entries from `pointers[k]` to
/// `pointers[k + 1]`, in any order, each with its column.
struct SparseRows {
    std::span<const std::int32_t> pointers;
    std::span<const std::int32_t> columns;
    std::span<const double> values;
};

/// Lower triangle of a symmetric band, column by column from the diagonal down: `width + 1` entries
/// for each, those beyond the last row zero.
struct LowerBand {
    std::size_t width = 0;
    std::vector<double> entries;
};

/// Product of the transposed rows with the rows, of `size` columns.
/// Throws std::invalid_argument where an entry has no such column, a row no such entries, or so
/// many columns no room.
LowerBand gram(const SparseRows& rows, std::size_t size);

/// Squared lengths of what the inverse of a Cholesky factor makes of rows, one for each: variances
/// of sums of the unknowns. `factor` is lower, laid out as a `LowerBand` of `size` columns.
/// Throws as `gram`, and where the factor is of another size or has a zero on its diagonal.
std::vector<double> squares(std::span<const double> factor, std::size_t size,
                            const SparseRows& rows);

}  // namespace sysid
