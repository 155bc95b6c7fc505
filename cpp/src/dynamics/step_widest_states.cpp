// The model with derivatives by as many states as fit into one pass.
#include "sysid/dynamics/step.hpp"

namespace sysid {

SYSID_COMPILED_MODEL(, Dual<kWidestStatePass>, double)

}  // namespace sysid
