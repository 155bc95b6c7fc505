#include "sysid/identify/made_of.hpp"

#include <algorithm>
#include <bit>

namespace sysid {

namespace {

/// Tells lists of numbers apart. Four chains, for in one every product would wait for the one
/// before.
class Digest {
  public:
    void add(double x) {
        std::uint64_t& chain = chains_[count_++ % chains_.size()];
        chain = mixed(chain ^ std::bit_cast<std::uint64_t>(x));
    }
    std::uint64_t value() const {
        std::uint64_t all = count_;
        for (const std::uint64_t chain : chains_) all = mixed(all ^ chain);
        return all;
    }

  private:
    /// The shift hands on what products keep in the highest bits: signs.
    static std::uint64_t mixed(std::uint64_t x) {
        constexpr std::uint64_t kGolden = 0x9e3779b97f4a7c15;  // 2^64 over the golden ratio, odd
        x *= kGolden;
        return x ^ (x >> 32U);
    }

    std::array<std::uint64_t, 4> chains_{1, 2, 3, 4};
    std::size_t count_ = 0;
};

std::uint64_t digest_of(const Problem& problem) {
    const SingleTrack& model = problem.model;
    Digest digest;
    using Car = std::array<double, sizeof(VehicleData) / sizeof(double)>;
    for (const double x : std::bit_cast<Car>(model.car)) digest.add(x);
    digest.add(std::bit_cast<double>(model.effects));
    for (const bool on :
         {model.force_known, model.loads_known, model.slope_known, model.inputs_held})
        digest.add(on ? 1.0 : 0.0);
    digest.add(model.most_n.front);
    digest.add(model.most_n.rear);
    for (const Run& run : problem.runs) {
        digest.add(run.dt);
        digest.add(static_cast<double>(run.size()));
        for (const Input& u : run.inputs) {
            digest.add(u.steer_rad);
            digest.add(u.longitudinal);
            digest.add(u.time_s);
            digest.add(u.steer_rate_radps);
            digest.add(u.loads_n.front);
            digest.add(u.loads_n.rear);
            if (!model.slope_known) continue;
            digest.add(u.gravity_x_mps2);
            digest.add(u.gravity_y_mps2);
        }
        for (const Vec<kChannels>& y : run.measurements)
            for (const double x : y) digest.add(x);
    }
    return digest.value();
}

}  // namespace

MadeOf::MadeOf(const Problem& problem, const double* p)
    : parameters_(p, p + kParameterCount), data_(digest_of(problem)) {}

bool MadeOf::is(const Problem& problem, const double* p) const {
    return problem.model.user == nullptr && !parameters_.empty() &&
           std::equal(parameters_.begin(), parameters_.end(), p) && digest_of(problem) == data_;
}

}  // namespace sysid
