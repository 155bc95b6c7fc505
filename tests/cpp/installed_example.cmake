# Installs the library to a fresh folder, builds the example against it and runs it.
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE failed OUTPUT_VARIABLE said ERROR_VARIABLE said)
  if(failed)
    message(FATAL_ERROR "${ARGN}\n${said}")
  endif()
  set(said "${said}" PARENT_SCOPE)
endfunction()

file(REMOVE_RECURSE "${work}")
run("${CMAKE_COMMAND}" --install "${built}" --component cpp --prefix "${work}/prefix")
# What Eigen's package says may be anywhere, or the folder of an isolated build: one that names the
# headers stands in for it.
file(WRITE "${work}/eigen/Eigen3Config.cmake"
     "add_library(Eigen3::Eigen INTERFACE IMPORTED)\n"
     "target_include_directories(Eigen3::Eigen SYSTEM INTERFACE \"${eigen}\")\n")
run("${CMAKE_COMMAND}" -S "${example}" -B "${work}/build" -G "${generator}"
    "-DCMAKE_CXX_COMPILER=${compiler}" "-DCMAKE_CXX_FLAGS=${flags}" -DCMAKE_BUILD_TYPE=Debug
    "-DCMAKE_PREFIX_PATH=${work}/prefix" "-DEigen3_DIR=${work}/eigen"
    "-Dsysid_vehicle_VERSION_WANTED=${version}")
run("${CMAKE_COMMAND}" --build "${work}/build")
run("${work}/build/fit_log" "${example}/slalom.csv")
message(STATUS "${said}")
# Of the car that made the log: 96.4 and 106.9 kN/rad.
foreach(axle IN ITEMS front rear)
  if(NOT said MATCHES "${axle} +([0-9.]+) \\+- ([0-9.]+) kN/rad")
    message(FATAL_ERROR "no stiffness of the ${axle} axle in:\n${said}")
  endif()
  set(${axle} ${CMAKE_MATCH_1})
endforeach()
if(front LESS 93 OR front GREATER 100 OR rear LESS 103 OR rear GREATER 111)
  message(FATAL_ERROR "the stiffness is not that of the car:\n${said}")
endif()
