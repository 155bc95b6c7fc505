// The kernels for any processor.
#include "sysid/math/lanes.hpp"

#define SYSID_LANE_BYTES 16
#include "lanes.inc"
#include "lanes_back.inc"
#include "lanes_filter.inc"
#include "lanes_rows.inc"
#include "lanes_score.inc"
#include "lanes_sums.inc"

extern const LaneKernels kPlainLanes;
const LaneKernels kPlainLanes{
    "plain",  &forward, &backward,       &add_product,  &add_squares,  &curve_squares, &propagate,
    &disturb, &correct, &propagate_rows, &correct_rows, &score_update, &score_predict};

}  // namespace sysid
