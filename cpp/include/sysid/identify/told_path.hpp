// The linearised filter along a path that a filter has told, sample by sample.
#pragma once

#include <vector>

#include "sysid/estimate/noise_score.hpp"
#include "sysid/identify/local_model.hpp"
#include "sysid/identify/prediction_error.hpp"

namespace sysid {

/// How single samples answer to states is worked out for many of them side by side, as for
/// `normal_equations`.
class ToldPath {
  public:
    static constexpr std::size_t kTogether = std::size_t{8} * kLanes;

    /// `filter` has run on the problem with these parameters (`FrozenFilter::tells_of`).
    ToldPath(const Problem& problem, const double* p, const FrozenFilter& filter);

    /// States that have a transition; the disturbances stand behind them.
    std::size_t moving() const { return local_.states(); }
    std::size_t states() const { return filter_.rows.size(); }

    /// Makes samples `first` to `first + count` of a run ready, `kTogether` at most.
    void linearise(std::size_t run, std::size_t first, std::size_t count);
    /// One of them.
    ScoreSample sample(std::size_t run, std::size_t k) const;

  private:
    const Problem& problem_;
    const FrozenFilter& filter_;
    LocalModel local_;
    std::size_t first_ = 0;
    std::vector<PathSample> samples_;
    std::vector<double> predicted_, derivatives_;
};

/// A sample of the numbers that `LaneFilter::write_sample` wrote, number `k` of its run.
ScoreSample score_sample(const double* numbers, std::size_t states, std::size_t moving,
                         std::size_t k);

}  // namespace sysid
