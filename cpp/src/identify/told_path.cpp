#include "sysid/identify/told_path.hpp"

namespace sysid {

ToldPath::ToldPath(const Problem& problem, const double* p, const FrozenFilter& filter)
    : problem_(problem),
      filter_(filter),
      local_(problem.model, p, {}, 0, filter.noise.disturbances()),
      samples_(kTogether),
      predicted_(kTogether * filter.rows.size()),
      derivatives_(kTogether * local_.size()) {}

void ToldPath::linearise(std::size_t run, std::size_t first, std::size_t count) {
    const std::size_t n = states();
    first_ = first;
    for (std::size_t j = 0; j < count; ++j) {
        const std::size_t k = first + j;
        double* here = predicted_.data() + j * n;
        filter_.predicted(run, k, here);
        PathSample& s = samples_[j];
        s = {&problem_.runs[run], k, 0, nullptr, nullptr, here, here + moving()};
        if (k == 0) continue;
        s.substeps = filter_.runs[run].substeps[k];
        s.before = filter_.told(run, k - 1) + kChannels;
        s.pushed = s.before + moving();
    }
    local_.differentiate(samples_.data(), count, derivatives_.data());
}

ScoreSample ToldPath::sample(std::size_t run, std::size_t k) const {
    const double* by = derivatives_.data() + (k - first_) * local_.size();
    ScoreSample s;
    s.transition = k > 0 ? by : nullptr;
    s.observation = by + local_.read();
    s.gain = filter_.gain(run, k);
    s.whitener = filter_.whitener(run, k);
    s.innovation = filter_.told(run, k);
    s.mean = s.innovation + kChannels;
    s.covariance = s.mean + states();
    return s;
}

ScoreSample score_sample(const double* numbers, std::size_t states, std::size_t moving,
                         std::size_t k) {
    ScoreSample s;
    s.transition = k > 0 ? numbers : nullptr;
    s.observation = numbers += moving * states;
    s.gain = numbers += kChannels * states;
    s.whitener = numbers += states * kChannels;
    s.innovation = numbers += kWhitener;
    s.mean = numbers += kChannels;
    s.covariance = numbers + states;
    return s;
}

}  // namespace sysid
