# find_package(Trammel): Trammel::trammel is libtrammel, the library for other programs. It needs <tl/expected.hpp> (package
# libexpected-dev) and nothing else of what Trammel is made of.
include(${CMAKE_CURRENT_LIST_DIR}/TrammelTargets.cmake)
