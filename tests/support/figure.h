#pragma once

#include <cstdio>
#include <string>

namespace trammel::test {

/// Prints a figure that the project claims, by the name it has in tests/benchmarks/README.md:
/// `figure NAME: VALUE`.
inline void tell_figure(const std::string& name, double value) {
  std::printf("figure %s: %.6g\n", name.c_str(), value);
  std::fflush(stdout);
}

}  // namespace trammel::test
