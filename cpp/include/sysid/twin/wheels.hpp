// One number for each of the four wheels, and arithmetic on all of them at once: two by two in the
// registers for two doubles that every 64-bit processor has, the four chains of operations
// interleaved. GCC and Clang translate the pairs to whatever the processor offers.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace sysid {

constexpr std::size_t kWheels = 4;  // front left, front right, rear left, rear right

using Pair = double __attribute__((vector_size(16)));
using PairMask = decltype(Pair{} < Pair{});

struct Wheels {
    Pair front{}, rear{};  // left, right

    Wheels() = default;
    Wheels(Pair f, Pair r) : front(f), rear(r) {}
    Wheels(double all) : front{all, all}, rear{all, all} {}
    Wheels(double f, double r) : front{f, f}, rear{r, r} {}

    /// Four numbers that stand side by side in memory.
    static Wheels at(const double* from) {
        Wheels w;
        std::memcpy(&w.front, from, sizeof(Pair));
        std::memcpy(&w.rear, from + 2, sizeof(Pair));
        return w;
    }
    void put(double* to) const {
        std::memcpy(to, &front, sizeof(Pair));
        std::memcpy(to + 2, &rear, sizeof(Pair));
    }
    double operator[](std::size_t wheel) const {
        return wheel < 2 ? front[wheel] : rear[wheel - 2];
    }
};

struct WheelMask {
    PairMask front, rear;
};

inline Wheels operator+(Wheels a, Wheels b) { return {a.front + b.front, a.rear + b.rear}; }
inline Wheels operator-(Wheels a, Wheels b) { return {a.front - b.front, a.rear - b.rear}; }
inline Wheels operator*(Wheels a, Wheels b) { return {a.front * b.front, a.rear * b.rear}; }
inline Wheels operator/(Wheels a, Wheels b) { return {a.front / b.front, a.rear / b.rear}; }
inline Wheels operator-(Wheels a) { return {-a.front, -a.rear}; }
inline WheelMask operator<(Wheels a, Wheels b) { return {a.front < b.front, a.rear < b.rear}; }
inline WheelMask operator>(Wheels a, Wheels b) { return b < a; }

/// a where the mask holds, else b; a number that is not chosen may be anything.
inline Wheels choose(WheelMask m, Wheels a, Wheels b) {
    return {m.front ? a.front : b.front, m.rear ? a.rear : b.rear};
}
inline double choose(bool m, double a, double b) { return m ? a : b; }

/// The larger one; b where a is not a number.
inline Wheels larger(Wheels a, Wheels b) { return choose(a > b, a, b); }
inline double larger(double a, double b) { return a > b ? a : b; }
inline Wheels magnitude(Wheels a) { return larger(a, -a); }

#ifdef __SSE2__
inline Wheels root(Wheels a) { return {_mm_sqrt_pd(a.front), _mm_sqrt_pd(a.rear)}; }
#else
inline Wheels root(Wheels a) {
    return {Pair{std::sqrt(a.front[0]), std::sqrt(a.front[1])},
            Pair{std::sqrt(a.rear[0]), std::sqrt(a.rear[1])}};
}
#endif
inline double root(double a) { return std::sqrt(a); }

/// Each wheel's number at the other wheel of its axle.
inline Wheels across_axle(Wheels a) {
    return {Pair{a.front[1], a.front[0]}, Pair{a.rear[1], a.rear[0]}};
}

inline double sum(Wheels a) {
    const Pair sides = a.front + a.rear;
    return sides[0] + sides[1];
}

}  // namespace sysid
