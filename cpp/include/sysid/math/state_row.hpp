// What an object remembers as one row of numbers, so that it can be stored, copied and resumed.
//
// A class lists its members once, in `template <class Row> void remember(Row& row)`, by `row(a,
// b)`; `StateWriter` reads them there and `StateReader` sets them. Members may be numbers,
// enumerations, Eigen matrices, arrays, plain structures of doubles, and classes with such a list.
#pragma once

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "sysid/math/linear.hpp"

namespace sysid {

namespace state_row {

template <class T, class Row, class = void>
struct Remembers : std::false_type {};
template <class T, class Row>
struct Remembers<T, Row, std::void_t<decltype(std::declval<T&>().remember(std::declval<Row&>()))>>
    : std::true_type {};

/// Whether a whole number or an enumeration can be cast from this; nothing that is no number is.
template <class T>
bool holds(double number) {
    if constexpr (std::is_enum_v<T>) {
        return holds<std::underlying_type_t<T>>(number);
    } else {
        using Limits = std::numeric_limits<T>;
        return number >= static_cast<double>(Limits::lowest()) &&
               number < std::ldexp(1.0, Limits::digits);
    }
}

/// Walks over one member; `row.number(double&)` is called for every number in it.
template <class Row, class T>
void walk(Row& row, T& item) {
    if constexpr (std::is_same_v<T, double>) {
        row.number(item);
    } else if constexpr (std::is_arithmetic_v<T> || std::is_enum_v<T>) {
        auto number = static_cast<double>(item);
        row.number(number);
        if (!holds<T>(number))
            throw std::invalid_argument("the stored state holds " + std::to_string(number) +
                                        " in place of a whole number");
        item = static_cast<T>(number);
    } else if constexpr (Remembers<T, Row>::value) {
        item.remember(row);
    } else if constexpr (std::is_trivially_copyable_v<T>) {  // a plain structure of doubles
        static_assert(sizeof(T) % sizeof(double) == 0 && alignof(T) == alignof(double));
        std::array<double, sizeof(T) / sizeof(double)> numbers{};
        std::memcpy(numbers.data(), &item, sizeof(T));
        for (double& number : numbers) row.number(number);
        std::memcpy(static_cast<void*>(&item), numbers.data(), sizeof(T));
    } else {  // a matrix
        for (Eigen::Index i = 0; i < item.size(); ++i) row.number(item.data()[i]);
    }
}

}  // namespace state_row

class StateWriter {
  public:
    static constexpr bool kReads = false;

    /// The row of an object; it is taken by value because its list of members is not constant.
    template <class T>
    static std::vector<double> row_of(T object) {
        StateWriter writer;
        object.remember(writer);
        return std::move(writer.row_);
    }
    template <class... T>
    void operator()(T&... members) {
        (state_row::walk(*this, members), ...);
    }
    void number(const double& value) { row_.push_back(value); }

  private:
    std::vector<double> row_;
};

class StateReader {
  public:
    static constexpr bool kReads = true;

    /// Sets the members of `object`. Throws std::invalid_argument if the row is of another length.
    template <class T>
    static void restore(T& object, const std::vector<double>& row) {
        StateReader reader(row);
        object.remember(reader);
        if (reader.at_ != row.size()) throw std::invalid_argument(kOther);
    }
    template <class... T>
    void operator()(T&... members) {
        (state_row::walk(*this, members), ...);
    }
    void number(double& value) {
        if (at_ >= row_.size()) throw std::invalid_argument(kOther);
        value = row_[at_++];
    }

  private:
    static constexpr const char* kOther =
        "the stored state is of another length: it was made by another version";

    explicit StateReader(const std::vector<double>& row) : row_(row) {}

    const std::vector<double>& row_;
    std::size_t at_ = 0;
};

}  // namespace sysid
