// A car's model as programs for many samples side by side: a step of it, and a reading.
#pragma once

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "sysid/identify/problem.hpp"
#include "sysid/math/lanes.hpp"
#include "sysid/math/recorder.hpp"

namespace sysid {

/// Inputs of a step are states, externals, the `Input` it begins with, the one it ends with, and
/// the parameters; of a reading the same with one `Input`. States are packed: v_x, v_y, r, then
/// those of the model's effects.
class RecordedModel {
  public:
    /// A program with the rows it works on.
    struct Ready {
        Program program;
        std::vector<LaneRow> rows, adjoints;
        /// Numbers of each `Input` that the program reads, and their rows.
        std::vector<std::vector<std::pair<std::size_t, std::size_t>>> given;

        void set(std::size_t input, std::size_t lane, double value) {
            const std::int32_t row = program.inputs[input];
            if (row >= 0) rows[static_cast<std::size_t>(row)].at[lane] = value;
        }
        /// From input number `first` on.
        void set(std::size_t first, const LaneRow* values, std::size_t count);
        /// The `Input` number `which` of one lane.
        void give(std::size_t which, std::size_t lane, const Input& u);
        const LaneRow& output(std::size_t i) const {
            return rows[static_cast<std::size_t>(program.outputs[i])];
        }
        void run() {
            lane_kernels().forward(program.steps.data(), program.steps.size(), rows.data());
        }
    };

    /// With derivatives by states, by the first so many externals and by the parameters `columns`;
    /// the other externals are zero.
    RecordedModel(const SingleTrack& model, const double* p, const std::vector<int>& columns,
                  std::size_t externals);
    /// With parameters of its own in each lane. Throws `NumericalFailure` where they lead to other
    /// steps.
    RecordedModel(const SingleTrack& model, const std::vector<const double*>& sets,
                  const std::vector<int>& columns, std::size_t externals);

    const SingleTrack& model() const { return model_; }
    const double* parameters(std::size_t lane) const { return sets_[sets_.size() > 1 ? lane : 0]; }
    const ActiveStates& own() const { return own_; }
    std::size_t states() const { return states_; }
    std::size_t externals() const { return externals_; }
    /// What moves from sample to sample.
    std::size_t moving() const { return states_ + externals_; }

    Ready& reading() { return read_; }
    /// In how many programs a step of `parts` is done: where inputs are held its parts belong
    /// together.
    int programs(int parts) const { return model_.inputs_held ? 1 : parts; }
    /// One of these, of a step over `dt` seconds.
    Ready& step_of(double dt, int parts);
    /// The states with which a run begins; inputs are the parameters.
    Ready start_of(const Run& run) const;

    /// Calls `put(output, input, row)` for every derivative that is not zero, while the row holds
    /// it; nullptr for ones.
    template <class Put>
    static void sweep(Ready& ready, Put&& put) {
        const Program& program = ready.program;
        const auto place = [](std::int32_t i) { return static_cast<std::size_t>(i); };
        for (std::size_t o = 0; o < program.same_as.size(); ++o)
            if (program.same_as[o] >= 0) put(o, place(program.same_as[o]), nullptr);
        for (const Sweep& s : program.sweeps) {
            const std::size_t wide = s.outputs.size();
            const auto slot = [&](std::int32_t i) {
                return ready.adjoints.data() + place(i) * wide;
            };
            for (const std::int32_t seed : s.seeds)
                for (std::size_t m = 0; m < wide; ++m) std::fill_n(slot(seed)[m].at, kLanes, 0.0);
            for (std::size_t m = 0; m < wide; ++m) std::fill_n(slot(s.seeds[m])[m].at, kLanes, 1.0);
            lane_kernels().backward(s.steps.data(), s.steps.size(), static_cast<int>(wide),
                                    ready.rows.data(), ready.adjoints.data());
            for (std::size_t i = 0; i < s.inputs.size(); ++i)
                for (std::size_t m = 0; s.inputs[i] >= 0 && m < wide; ++m)
                    put(place(s.outputs[m]), i, static_cast<const LaneRow*>(slot(s.inputs[i]) + m));
        }
    }

    static constexpr std::size_t kGiven = 8 + kUserChannels;  // numbers of an `Input`

  private:
    struct Moving {
        ModelState<Recorded> x{};
        std::array<Recorded, kExternals> external{};
    };

    Moving moving(Recorder& to) const;
    std::vector<Recorded> parameters(Recorder& to, const double* p) const;
    std::vector<Recorded> packed(const ModelState<Recorded>& x) const;
    /// `record(to, parameters)` gives the outputs.
    template <class Record>
    Ready ready(std::size_t inputs_given, Record&& record) const;

    SingleTrack model_;
    std::vector<const double*> sets_;  // of parameters: one, or one for each lane
    std::vector<bool> wanted_;         // of the parameters
    ActiveStates own_;
    std::size_t states_, externals_;
    Ready read_;
    std::map<std::pair<double, int>, Ready> steps_;  // by length and number of parts
};

}  // namespace sysid
