// The model as a list of its steps.
#include "sysid/dynamics/step.hpp"

namespace sysid {

SYSID_COMPILED_MODEL(, Recorded, Recorded)

}  // namespace sysid
