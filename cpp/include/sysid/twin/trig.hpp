// Arc tangent and sine for the ranges of a tyre curve, in line and without branches, so that four
// wheels go through them at once: the library's calls would take half of a car's step. Moshier's
// Cephes polynomials; both stay within 3e-16 of the library. `T` is `double` or `Wheels`.
#pragma once

#include "sysid/twin/wheels.hpp"

namespace sysid {

/// atan(x) for x >= 0.
template <class T>
inline T atan_of_positive(T x) {
    const T one = 1.0;
    const auto far = x > T(2.41421356237309504880);
    const auto middle = x > T(0.66);
    const T base =
        choose(far, T(1.57079632679489661923), choose(middle, T(0.785398163397448309616), T(0.0)));
    const T y = choose(far, -one, choose(middle, x - one, x)) /
                choose(far, x, choose(middle, x + one, one));
    const T z = y * y;
    const T above = (((T(-8.750608600031904122785e-1) * z - T(1.615753718733365076637e1)) * z -
                      T(7.500855792314704667340e1)) *
                         z -
                     T(1.228866684490136173410e2)) *
                        z -
                    T(6.485021904942025371773e1);
    const T below = ((((z + T(2.485846490142306297962e1)) * z + T(1.650270098316988542046e2)) * z +
                      T(4.328810604912902668951e2)) *
                         z +
                     T(4.853903996359136964868e2)) *
                        z +
                    T(1.945506571482613964425e2);
    return base + (y + y * z * above / below);
}

/// sin(x) for 0 <= x <= 3/2 pi.
template <class T>
inline T sin_of_positive(T x) {
    const T pi = 3.14159265358979323846;
    const T half = T(0.5) * choose(x > T(0.5) * pi, pi - x, x);
    const T z = half * half;
    const T sine =
        half + half * z *
                   (((((T(1.58962301576546568060e-10) * z - T(2.50507477628578072866e-8)) * z +
                       T(2.75573136213857245213e-6)) *
                          z -
                      T(1.98412698295895385996e-4)) *
                         z +
                     T(8.33333333332211858878e-3)) *
                        z -
                    T(1.66666666666666307295e-1));
    const T cosine =
        T(1.0) - T(0.5) * z +
        z * z *
            (((((T(-1.13585365213876817300e-11) * z + T(2.08757008419747316778e-9)) * z -
                T(2.75573141792967388112e-7)) *
                   z +
               T(2.48015872888517045348e-5)) *
                  z -
              T(1.38888888888730564116e-3)) *
                 z +
             T(4.16666666666665929218e-2));
    return T(2.0) * sine * cosine;
}

}  // namespace sysid
