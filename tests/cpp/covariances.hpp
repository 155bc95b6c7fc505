// Covariances stay positive definite, whatever the noise and however long the record. Every filter
// runs with its process noise from 1e-12 to 1e6 times its measurement noise (of standard
// deviations), all ratios together over a million steps.
#pragma once

#include "helpers.hpp"

namespace sysid::test {

constexpr std::array<double, 7> kRatios{1e-12, 1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6};
constexpr std::size_t kSteps = 150'000;

/// Not below zero by more than the digits of its elements can tell.
bool positive(const Eigen::MatrixXd& P);

inline bool worth_a_look(std::size_t k) { return k < 200 || k % 1000 == 0; }

}  // namespace sysid::test
