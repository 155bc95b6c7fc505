# sysid_compiler carries the flags that every target of the project shares. They are for its own
# sources: who links the library compiles with flags of their own.

add_library(sysid_compiler INTERFACE)

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
