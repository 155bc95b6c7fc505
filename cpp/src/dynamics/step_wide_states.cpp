// The model with derivatives by the states of many effects.
#include "sysid/dynamics/step.hpp"

namespace sysid {

SYSID_COMPILED_MODEL(, Dual<kWideStatePass>, double)

}  // namespace sysid
