// A sampled signal between its samples.
#pragma once

#include <cstddef>

namespace sysid {

/// Samples on either side of a place between samples that its value is made of.
constexpr int kShiftReach = 10;

/// `value[k]` is the signal `late` samples before its sample k, `slope[k]` its derivative there by
/// samples. Between samples stands what a signal of their bandwidth has there (windowed sinc): a
/// straight line would average their noise, and a model whose input is less noisy predicts better
/// for the wrong reason. Where `late` is whole these are the samples themselves. Beyond its ends
/// the signal is turned about them, so that value and slope go on.
void shift_in_time(const double* signal, std::size_t count, double late, double* value,
                   double* slope);

}  // namespace sysid
