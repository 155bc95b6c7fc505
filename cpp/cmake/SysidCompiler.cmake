# sysid_compiler carries the flags that every target of the project shares.

add_library(sysid_compiler INTERFACE)

# Eigen's own threads would compete with the Python threads that run the kernels side by side.
target_compile_definitions(sysid_compiler INTERFACE EIGEN_MPL2_ONLY EIGEN_DONT_PARALLELIZE)

if(CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
  # Nobody reads errno or floating-point traps here; without them the loops vectorise. NaN and
  # infinity keep their meaning, which fast-math would take away.
  target_compile_options(sysid_compiler INTERFACE -fno-math-errno -fno-trapping-math)
  target_compile_options(
    sysid_compiler
    INTERFACE -Wall
              -Wextra
              -Wpedantic
              -Wconversion
              -Wshadow
              -Wnon-virtual-dtor
              -Woverloaded-virtual
              -Wcast-align
              -Wdouble-promotion)
  if(SYSID_WARNINGS_AS_ERRORS)
    target_compile_options(sysid_compiler INTERFACE -Werror)
  endif()
endif()
