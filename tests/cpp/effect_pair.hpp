// One instant with and without an effect.
#pragma once

#include "helpers.hpp"

namespace sysid::test {

inline const ModelState<double> kCornering{25.0, 0.5, 0.35};
inline const Input kBraking{0.06, -4000.0};
inline const Input kDriving{0.06, 3000.0};

/// One effect at a size of its own, and the same instant without it.
struct Pair {
    Evaluation on, off;
    Parameters p;

    Pair(const std::string& id, const std::vector<double>& size, const ModelState<double>& x,
         const Input& u, bool force_known = true)
        : p(plain_parameters()) {
        for (std::size_t j = 0; j < size.size(); ++j) p[parameter_of(id, j)] = size[j];
        on = evaluate({saloon(), mask_of({id}), force_known}, x, u, p);
        off = evaluate({saloon(), 0, force_known}, x, u, p);
    }
};

/// Loads of the axles without what the acceleration moves between them: m a_x h/L, eq. (5).
inline Axles<double> rest(const Evaluation& at) {
    const VehicleData car = saloon();
    const double moved = car.cg_height_m / (car.lf_m + car.lr_m) * car.mass_kg * at.w.a_x;
    return {at.w.fz_f + moved, at.w.fz_r - moved};
}

/// Lateral force per load with the effect, over that without it.
inline Axles<double> per_load(const Pair& it) {
    return {it.on.w.fy_f / it.on.w.fz_f * it.off.w.fz_f / it.off.w.fy_f,
            it.on.w.fy_r / it.on.w.fz_r * it.off.w.fz_r / it.off.w.fy_r};
}

}  // namespace sysid::test
