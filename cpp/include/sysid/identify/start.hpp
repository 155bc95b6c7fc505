// How sure the state is where a run starts.
#pragma once

#include <Eigen/Dense>

#include "sysid/identify/problem.hpp"

namespace sysid {

/// Covariance of the motion and of the effects' states, in the order of `active_states`, at `x`,
/// where all of them have settled.
///
/// A state that follows a quantity at a rate lambda is as unsure as that quantity is, and by how
/// far it lags behind it: a short lag leaves nothing of that, so that the likelihood of a lag that
/// goes to nothing is that of the model without it.
Eigen::MatrixXd start_covariance(const SingleTrack& model, const ModelState<double>& x,
                                 const Input& u, const double* p);

}  // namespace sysid
