// The model differentiated by the motion alone.
#include "sysid/dynamics/step.hpp"

namespace sysid {

SYSID_COMPILED_MODEL(, Dual<kMotionStates>, double)

}  // namespace sysid
