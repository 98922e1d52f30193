#pragma once

#include <string>

namespace trammel::test {

inline bool has(const std::string& page, const std::string& part) {
  return page.find(part) != std::string::npos;
}

}  // namespace trammel::test
