# Finds Eigen and provides the target Eigen3::Eigen. Order: what the user names with -DEigen3_ROOT or
# -DEigen3_DIR, then the PyPI wheel cmeel-eigen (a build requirement, so `pip install` needs nothing
# from the system), then the system's own. SYSID_EIGEN_PACKAGE is the folder of its package, for those
# who use the installed library.

if(NOT Eigen3_ROOT AND NOT Eigen3_DIR AND Python_EXECUTABLE)
  # The wheel keeps Eigen in a folder of its own, where find_package does not look by itself.
  execute_process(
    COMMAND "${Python_EXECUTABLE}" -c
            "import importlib.metadata as m; \
print(m.distribution('cmeel-eigen').locate_file('cmeel.prefix/share/eigen3/cmake'))"
    OUTPUT_VARIABLE wheel_dir
    OUTPUT_STRIP_TRAILING_WHITESPACE
    ERROR_QUIET
    RESULT_VARIABLE failed)
  if(NOT failed AND EXISTS "${wheel_dir}/Eigen3Config.cmake")
    find_package(Eigen3 CONFIG REQUIRED PATHS "${wheel_dir}" NO_DEFAULT_PATH)
    set(SYSID_EIGEN_PACKAGE "${Eigen3_DIR}")
    unset(Eigen3_DIR CACHE) # the folder of an isolated build is gone at the next configure
  endif()
endif()

if(NOT TARGET Eigen3::Eigen)
  find_package(Eigen3 CONFIG QUIET)
  set(SYSID_EIGEN_PACKAGE "${Eigen3_DIR}")
endif()
if(NOT TARGET Eigen3::Eigen)
  message(
    FATAL_ERROR
      "Eigen was not found. Do one of these: pip install 'cmeel-eigen<4'; "
      "apt-get install libeigen3-dev; or name its folder with -DEigen3_ROOT=...")
endif()

# No version in find_package: a request for 3.4 would refuse Eigen 5.
if(Eigen3_VERSION VERSION_LESS 3.4)
  message(FATAL_ERROR "Eigen ${Eigen3_VERSION} is too old: 3.4 or newer is needed")
endif()
message(STATUS "Eigen ${Eigen3_VERSION}")
