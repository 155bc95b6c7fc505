// The model with derivatives by its parameters.
#include "sysid/dynamics/step.hpp"

namespace sysid {

SYSID_COMPILED_MODEL(, Dual<kParameterPass>, Dual<kParameterPass>)
SYSID_COMPILED_MODEL(, Dual<kShortParameterPass>, Dual<kShortParameterPass>)

}  // namespace sysid
