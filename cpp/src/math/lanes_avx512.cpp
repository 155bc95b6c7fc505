// The kernels for processors with AVX-512.
#ifdef SYSID_AVX512
#include "sysid/math/lanes.hpp"

#define SYSID_LANE_BYTES 64
#include "lanes.inc"
#include "lanes_back.inc"
#include "lanes_filter.inc"
#include "lanes_rows.inc"
#include "lanes_score.inc"
#include "lanes_sums.inc"

extern const LaneKernels kAvx512Lanes;
const LaneKernels kAvx512Lanes{
    "AVX-512", &forward, &backward,       &add_product,  &add_squares,  &curve_squares, &propagate,
    &disturb,  &correct, &propagate_rows, &correct_rows, &score_update, &score_predict};

}  // namespace sysid
#endif
