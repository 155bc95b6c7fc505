// The extended Kalman filter over pieces of driving side by side: mean and covariance in lanes.
#pragma once

#include <functional>

#include "sysid/estimate/kalman.hpp"
#include "sysid/identify/prediction_error.hpp"
#include "sysid/identify/side_by_side.hpp"

namespace sysid {

/// What `side_by_side` walks with. The states are in the order of `filter_rows`, the lower triangle
/// of their covariance stands behind them.
class LaneFilter {
  public:
    using Rows = std::vector<LaneRow>;

    /// `sets` of parameters: one, or one for each lane, which are then those of the pieces.
    LaneFilter(const Problem& problem, const std::vector<const double*>& sets, const Noise& noise,
               const std::vector<Piece>& pieces);

    /// Gets every sample of every piece with the lane in which it was done and the parts of the
    /// step to it. A later one for the same sample holds.
    std::function<void(const LaneSample&, std::size_t lane, int parts)> keep;
    /// Gets the pieces `first` to `last` when they are done.
    std::function<void(std::size_t first, std::size_t last)> done;
    /// Whether transitions are asked for.
    bool with_transition = false;

    // Of the sample that `keep` was called for.
    const Rows& gain() const { return gain_; }          // states x readings
    const Rows& whitener() const { return whitener_; }  // lower triangle
    const Rows& innovation() const { return innovation_; }
    /// The whole sample, one after the other: transition (moving x states; of a first
    /// sample none), observation, gain, whitener, innovation, mean and the lower triangle of the
    /// covariance.
    void write_sample(std::size_t lane, double* to) const;
    /// How many numbers those are.
    std::size_t sample_size() const {
        return transition_.size() + seen_.size() + gain_.size() + kWhitener + kChannels +
               state_.size();
    }
    const Rows& state() const { return state_; }
    double deviation(std::size_t i, std::size_t lane) const {
        return std::sqrt(state_[n_ + packed(i, i)].at[lane]);
    }
    static double* write(const Rows& rows, std::size_t lane, double* to) {
        for (const LaneRow& row : rows) *to++ = row.at[lane];
        return to;
    }
    std::size_t states() const { return n_; }
    std::size_t moving() const { return model_.states(); }
    const ActiveStates& own() const { return model_.own(); }

    /// Of all pieces with a set of parameters.
    double log_likelihood(std::size_t set = 0) const;

    // For `side_by_side`.
    Rows& state() { return state_; }
    void begin(const Piece& piece, double* to) const;
    double distance(const double* a, const double* b) const;
    bool sample(const LaneSamples& samples);
    void finish(std::size_t first, std::size_t last) const {
        if (done) done(first, last);
    }

    static std::size_t packed(std::size_t i, std::size_t j) { return i * (i + 1) / 2 + j; }

  private:
    using Pointers = std::vector<const LaneRow*>;  // nullptr for zeros

    void differentiate(RecordedModel::Ready& ready, Rows& values, Pointers& to) const;
    void disturb(std::size_t lane, const Run& run);
    void chain(const LaneSamples& samples, const std::array<int, kLanes>& parts, std::size_t like,
               bool first);
    bool kept(const LaneSample& s, std::size_t lane, int parts);

    const Problem& problem_;
    Noise noise_;
    const std::vector<Piece>& pieces_;
    RecordedModel model_;
    std::array<double, kLanes> rate_{};
    std::size_t n_;
    Rows state_, part_, observation_, transition_, gain_, forget_, process_;
    Rows whitener_, innovation_, present_, variance_, sensors_;
    Rows one_after_;  // innovations of readings that are used one after the other
    Pointers by_state_, seen_;
    LaneRow one_;
    std::array<const Run*, kLanes> disturbed_{};
    std::vector<std::size_t> first_block_;
    std::vector<LogDensity> density_;
};

}  // namespace sysid
