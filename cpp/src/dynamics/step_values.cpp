// The model without derivatives, and with those that the filter takes by its states.
#include "sysid/dynamics/step.hpp"

namespace sysid {

SYSID_COMPILED_MODEL(, double, double)
SYSID_COMPILED_MODEL(, Dual<kStatePass>, double)

}  // namespace sysid
