// What a car weighs and how it is spread: loads at positions to mass, centre of mass and inertia.
//
// Dettu, Formentin, Savaresi, Joint vehicle state and parameters estimation via Twin-in-the-Loop
// observers (2023), eqs. (6) to (8), with two corrections:
//   (6) the weighted sum of positions is divided by the total mass;
//   (8) moving the chassis' reference point adds m0 d^2 (Huygens-Steiner); the paper subtracts it.
// Products of inertia are J_xy = sum of m x y and so on; the inertia tensor has their negatives.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

namespace sysid {

/// Position of the centre of mass [m]: x ahead of the front axle (negative inside the wheelbase),
/// y to the left of the middle, z above the ground.
struct Load {
    double mass_kg = 2125.8;
    double jxx_kgm2 = 834.23, jyy_kgm2 = 3640.182, jzz_kgm2 = 3932.77;
    double cg_x_m = -1.25, cg_y_m = -0.00003, cg_z_m = 0.644;
    double jxy_kgm2 = 0.14, jxz_kgm2 = 0.097, jyz_kgm2 = 3.86;
};

/// The numbers of a load that an observer may estimate, in the order of `Load`.
enum LoadParameter : int {
    kMass,
    kJxx,
    kJyy,
    kJzz,
    kCgX,
    kCgY,
    kCgZ,
    kJxy,
    kJxz,
    kJyz,
    kLoadParameters,
};

using LoadVector = std::array<double, kLoadParameters>;

inline LoadVector to_vector(const Load& l) {
    return {
        l.mass_kg, l.jxx_kgm2, l.jyy_kgm2, l.jzz_kgm2, l.cg_x_m,
        l.cg_y_m,  l.cg_z_m,   l.jxy_kgm2, l.jxz_kgm2, l.jyz_kgm2,
    };
}

inline Load to_load(const LoadVector& v) {
    return {
        v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8], v[9],
    };
}

/// What an observer estimates: a load, and a factor of those inputs whose size is uncertain.
constexpr int kInputScale = kLoadParameters;
constexpr std::size_t kEstimates = kLoadParameters + 1;
using Estimates = std::array<double, kEstimates>;

inline Estimates to_estimates(const Load& l) {
    Estimates e{};
    const LoadVector v = to_vector(l);
    std::copy(v.begin(), v.end(), e.begin());
    e[kInputScale] = 1.0;
    return e;
}

inline Load to_load(const Estimates& e) {
    LoadVector v;
    std::copy_n(e.begin(), v.size(), v.begin());
    return to_load(v);
}

struct PointMass {
    double mass_kg;
    double x_m, y_m, z_m;  // in the axes of `Load`
};

/// The car with point masses added.
inline Load loaded(const Load& car, const std::vector<PointMass>& masses) {
    Load out = car;
    double mx = car.mass_kg * car.cg_x_m;
    double my = car.mass_kg * car.cg_y_m;
    double mz = car.mass_kg * car.cg_z_m;
    for (const PointMass& m : masses) {
        out.mass_kg += m.mass_kg;
        mx += m.mass_kg * m.x_m;
        my += m.mass_kg * m.y_m;
        mz += m.mass_kg * m.z_m;
    }
    out.cg_x_m = mx / out.mass_kg;
    out.cg_y_m = my / out.mass_kg;
    out.cg_z_m = mz / out.mass_kg;
    const auto add = [&out](const PointMass& m) {
        const double x = m.x_m - out.cg_x_m;
        const double y = m.y_m - out.cg_y_m;
        const double z = m.z_m - out.cg_z_m;
        out.jxx_kgm2 += m.mass_kg * (y * y + z * z);
        out.jyy_kgm2 += m.mass_kg * (x * x + z * z);
        out.jzz_kgm2 += m.mass_kg * (x * x + y * y);
        out.jxy_kgm2 += m.mass_kg * x * y;
        out.jxz_kgm2 += m.mass_kg * x * z;
        out.jyz_kgm2 += m.mass_kg * y * z;
    };
    add({car.mass_kg, car.cg_x_m, car.cg_y_m, car.cg_z_m});
    for (const PointMass& m : masses) add(m);
    return out;
}

}  // namespace sysid
