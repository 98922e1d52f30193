#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>

namespace trammel {

/// Which lines of one kind go into a log: the first few of each while. Not thread-safe.
class LogLimit {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr int kMost = 60;  ///< lines of one kind
  static constexpr std::chrono::seconds kWithin{60};

  struct Verdict {
    bool goes = true;
    std::uint64_t left_out_before = 0;  ///< lines of this kind left out since the last one written
  };
  [[nodiscard]] Verdict look(std::string_view kind, Time now);

 private:
  struct While {
    Time began;
    int lines = 0;
    std::uint64_t left_out = 0;
  };
  std::map<std::string, While, std::less<>> kinds_;
};

}  // namespace trammel
