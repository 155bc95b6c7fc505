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
# The installed library knows the package of Eigen that it was built with. Where that was in the folder
# of an isolated build, one that names the headers stands in for it.
set(named)
if(NOT EXISTS "${eigen_package}/Eigen3Config.cmake")
  file(WRITE "${work}/eigen/Eigen3Config.cmake"
       "add_library(Eigen3::Eigen INTERFACE IMPORTED)\n"
       "target_include_directories(Eigen3::Eigen SYSTEM INTERFACE \"${eigen}\")\n")
  set(named "-DEigen3_DIR=${work}/eigen")
endif()
run("${CMAKE_COMMAND}" -S "${example}" -B "${work}/build" -G "${generator}"
    "-DCMAKE_CXX_COMPILER=${compiler}" "-DCMAKE_CXX_FLAGS=${flags}" -DCMAKE_BUILD_TYPE=Debug
    "-DCMAKE_PREFIX_PATH=${work}/prefix" ${named}
    "-Dsysid_vehicle_VERSION_WANTED=${version}")
run("${CMAKE_COMMAND}" --build "${work}/build")
run("${work}/build/fit_log" "${example}/slalom.csv")
message(STATUS "${said}")
# A log that it cannot use is refused by its line.
file(WRITE "${work}/short.csv" "names\n0.0,100.0,16.0,0.0,0.0,0.0\n")
execute_process(COMMAND "${work}/build/fit_log" "${work}/short.csv" RESULT_VARIABLE failed
                ERROR_VARIABLE why)
if(NOT failed OR NOT why MATCHES "line 2: 6 cells in place of 7")
  message(FATAL_ERROR "a column too few: ${why}")
endif()
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
