#include "sysid/identify/in_time.hpp"

#include "sysid/dynamics/steer_delay.hpp"
#include "sysid/math/shift.hpp"

namespace sysid {

InTime::InTime(const Problem& logged, const double* p) : logged_(logged) {
    if (((logged.model.effects >> effect_place<SteerDelay>()) & 1U) == 0) return;
    acting_ = logged;
    const double late = steer_delay(logged.model, p);
    std::vector<double> angle, value, rate;
    for (Run& run : acting_->runs) {
        angle = run.steer_before;
        for (const Input& u : run.inputs) angle.push_back(u.steer_rad);
        angle.insert(angle.end(), run.steer_after.begin(), run.steer_after.end());
        value.resize(angle.size());
        rate.resize(angle.size());
        shift_in_time(angle.data(), angle.size(), late / run.dt, value.data(), rate.data());
        std::size_t at = run.steer_before.size();
        for (Input& u : run.inputs) {
            u.steer_rad = value[at];
            u.steer_rate_radps = rate[at++] / run.dt;
        }
    }
}

}  // namespace sysid
