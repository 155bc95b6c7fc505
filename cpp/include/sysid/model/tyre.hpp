// Axle lateral force per unit of vertical load.
#pragma once

#include <cmath>

namespace sysid {

template <class S>
struct TyreCoefficients {
    S B, C, D, E;

    /// Slope of the force over its load at no slip: the cornering stiffness per load [1/rad].
    S slope() const { return B * C * D; }
};

/// Magic Formula, Pacejka, Tire and Vehicle Dynamics (3rd ed.), eq. (4.6) without shifts:
/// F_y / F_z = D sin(C atan(B alpha - E (B alpha - atan(B alpha)))).
template <class S, class T>
auto magic_formula(const S& alpha, const TyreCoefficients<T>& tyre) {
    using std::atan;
    using std::sin;
    const auto x = tyre.B * alpha;
    return tyre.D * sin(tyre.C * atan(x - tyre.E * (x - atan(x))));
}

}  // namespace sysid
