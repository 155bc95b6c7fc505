# find_package(sysid_vehicle CONFIG) provides the target sysid::core.
include(CMakeFindDependencyMacro)
find_dependency(Eigen3 CONFIG)
include("${CMAKE_CURRENT_LIST_DIR}/sysid_vehicleTargets.cmake")
