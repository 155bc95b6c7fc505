// How one sample of the model answers to states, disturbances and parameters: its derivatives at
// many samples of a known path, side by side.
//
// With frozen gains the path of the mean is known from the residuals themselves. The derivatives of
// each single step then do not depend on those of others, and are worked out for `kLanes` samples
// at once; what is left to be done one sample after the other is linear.
#pragma once

#include <vector>

#include "sysid/identify/recorded_model.hpp"

namespace sysid {

/// One sample of the path: before the step to it and after, up to its reading. States are packed:
/// v_x, v_y, r, then those of the model's effects.
struct PathSample {
    const Run* run = nullptr;
    std::size_t at = 0;              // sample of the run
    int substeps = 0;                // of the step to it; none for the first of a run
    const double* before = nullptr;  // corrected states of the sample before
    const double* pushed = nullptr;  // what disturbs the step to it, kExternals
    const double* here = nullptr;    // predicted states
    const double* pushed_here = nullptr;
};

class LocalModel {
  public:
    /// Derivatives by the parameters `columns`, for which `width` places are kept, by states and by
    /// the first so many externals.
    LocalModel(const SingleTrack& model, const double* p, const std::vector<int>& columns,
               std::size_t width, std::size_t externals);

    std::size_t states() const { return model_.states(); }
    std::size_t externals() const { return model_.externals(); }

    /// Numbers for one sample: of the step a row for each state by states and externals, then one
    /// for each by parameters; of the reading the same with a row for each channel.
    std::size_t size() const { return read_parameters_ + kChannels * width_; }
    std::size_t step_parameters() const { return step_parameters_; }
    std::size_t read() const { return read_at_; }
    std::size_t read_parameters() const { return read_parameters_; }

    /// Derivatives at `count` samples.
    void differentiate(const PathSample* samples, std::size_t count, double* out);

    /// Derivatives of the states with which a run begins: `width` for each.
    std::vector<double> start(const Run& run) const;

  private:
    using Ready = RecordedModel::Ready;

    void step(const PathSample* samples, const std::size_t* which, std::size_t count, double* out);
    void read(const PathSample* samples, std::size_t count, double* out);
    void chain(const std::vector<double>& part, double* whole) const;
    template <class Put>
    void spread(Ready& ready, std::size_t inputs_given, std::size_t by_state,
                std::size_t by_parameter, Put&& put) const;

    RecordedModel model_;
    std::vector<std::vector<std::size_t>> columns_of_;  // of each parameter
    std::size_t width_, step_parameters_, read_at_, read_parameters_;
};

}  // namespace sysid
