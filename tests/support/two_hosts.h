#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace trammel::test {

/// The faults of a bad line on its frames, each way.
struct LineFaults {
  double lost = 0;                     ///< share, [0, 1]
  std::chrono::milliseconds delay{0};  ///< of each
  std::chrono::milliseconds scatter{
      0};  ///< at most that much more, so that frames overtake each other
};

/// Two hosts, 10.88.N.1 and 10.88.N.2, that see only each other: network namespaces with a thread
/// of this process as their cable. They end with the test.
class TwoHosts {
 public:
  explicit TwoHosts(const LineFaults& faults = {});
  ~TwoHosts();
  TwoHosts(const TwoHosts&) = delete;
  TwoHosts& operator=(const TwoHosts&) = delete;

  /// Empty, or why there are none: it takes root, iproute2 and /dev/net/tun.
  [[nodiscard]] const std::string& why_not() const { return why_not_; }
  [[nodiscard]] const std::string& address(std::size_t host) const { return addresses_.at(host); }
  /// Takes a host's interface away, or gives it back.
  [[nodiscard]] bool set_interface(std::size_t host, bool up) const;
  /// Interrupts the line for that long; returns the end of the interruption.
  std::chrono::steady_clock::time_point cut_for(std::chrono::milliseconds time);
  /// Frames that came through, both ways.
  [[nodiscard]] std::uint64_t carried() const;
  void wait_until_carried(std::uint64_t frames) const;
  /// Repeats all frames from that host so far (the last 20,000), as an intruder on the line could;
  /// returns their number.
  std::size_t repeat_from(std::size_t host);
  /// The same command for that host.
  [[nodiscard]] std::vector<std::string> on(std::size_t host, std::vector<std::string> argv) const;

 private:
  class Line;

  [[nodiscard]] std::string set_up(const LineFaults& faults);

  std::array<std::string, 2> names_, addresses_;
  std::string why_not_;
  std::unique_ptr<Line> line_;
};

}  // namespace trammel::test
