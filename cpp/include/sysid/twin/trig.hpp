// Arc tangent and sine for the ranges of a tyre curve, in line: the library's calls would take half
// of a car's step. Moshier's Cephes polynomials; both stay within 3e-16 of the library.
#pragma once

namespace sysid {

/// atan(x) for x >= 0.
inline double atan_of_positive(double x) {
    double base = 0.0;
    double y = x;
    if (x > 2.41421356237309504880) {
        base = 1.57079632679489661923;
        y = -1.0 / x;
    } else if (x > 0.66) {
        base = 0.785398163397448309616;
        y = (x - 1.0) / (x + 1.0);
    }
    const double z = y * y;
    const double above = (((-8.750608600031904122785e-1 * z - 1.615753718733365076637e1) * z -
                           7.500855792314704667340e1) *
                              z -
                          1.228866684490136173410e2) *
                             z -
                         6.485021904942025371773e1;
    const double below = ((((z + 2.485846490142306297962e1) * z + 1.650270098316988542046e2) * z +
                           4.328810604912902668951e2) *
                              z +
                          4.853903996359136964868e2) *
                             z +
                         1.945506571482613964425e2;
    return base + (y + y * z * above / below);
}

/// sin(x) for 0 <= x <= 3/2 pi.
inline double sin_of_positive(double x) {
    constexpr double pi = 3.14159265358979323846;
    const double half = 0.5 * (x > 0.5 * pi ? pi - x : x);
    const double z = half * half;
    const double sine =
        half + half * z *
                   (((((1.58962301576546568060e-10 * z - 2.50507477628578072866e-8) * z +
                       2.75573136213857245213e-6) *
                          z -
                      1.98412698295895385996e-4) *
                         z +
                     8.33333333332211858878e-3) *
                        z -
                    1.66666666666666307295e-1);
    const double cosine =
        1.0 - 0.5 * z +
        z * z *
            (((((-1.13585365213876817300e-11 * z + 2.08757008419747316778e-9) * z -
                2.75573141792967388112e-7) *
                   z +
               2.48015872888517045348e-5) *
                  z -
              1.38888888888730564116e-3) *
                 z +
             4.16666666666665929218e-2);
    return 2.0 * sine * cosine;
}

}  // namespace sysid
