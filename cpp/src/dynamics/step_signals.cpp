// The model with derivatives by disturbances and shifts of readings.
#include "sysid/dynamics/step.hpp"

namespace sysid {

SYSID_COMPILED_MODEL(, Dual<kParameterPass>, double)

}  // namespace sysid
