#include "server/calibrate/off_drawing.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"

namespace trammel {

namespace {

/// How far a kind of number may be off, SI, and how people read it.
struct Kind {
  const char* symbol;
  double limit;
  const char* unit;
  double per_si;
};
const Kind kKinds[] = {{"q", from_deg(1), "deg", to_deg(1)},
                       {"d", from_mm(3), "mm", to_mm(1)},
                       {"a", from_mm(3), "mm", to_mm(1)},
                       {"alpha", 3e-3, "mrad", 1e3},
                       {"beta", 3e-3, "mrad", 1e3}};

/// The kind of `d4`; none of `x`, `theta7` (of a rail, which stands as it was mounted) or `C2`.
const Kind* kind_of(const std::string& name) {
  const std::size_t digits = name.find_first_of("0123456789");
  if (digits == std::string::npos || name.find_first_not_of("0123456789", digits) != std::string::npos) return nullptr;
  const std::string symbol = name.substr(0, digits);
  for (const Kind& kind : kKinds)
    if (symbol == kind.symbol) return &kind;
  return nullptr;
}

}  // namespace

std::vector<OffDrawing> off_drawing(const std::vector<IdentifiedParameter>& parameters) {
  std::vector<OffDrawing> off;
  for (const IdentifiedParameter& one : parameters) {
    const Kind* kind = kind_of(one.parameter.name);
    if (kind == nullptr || std::abs(one.value) - 2 * one.stddev <= kind->limit) continue;
    off.push_back({one.parameter.name,
                   fmt::format("{} {:.3g} {} (a robot may be {:.3g} off its drawing)", one.parameter.name,
                               kind->per_si * one.value, kind->unit, kind->per_si * kind->limit),
                   std::abs(one.value) / kind->limit});
  }
  std::sort(off.begin(), off.end(), [](const OffDrawing& a, const OffDrawing& b) { return a.times > b.times; });
  return off;
}

std::optional<std::string> off_drawing_text(const std::vector<IdentifiedParameter>& parameters) {
  constexpr std::size_t kNamed = 3;
  std::vector<OffDrawing> off = off_drawing(parameters);
  if (off.empty()) return std::nullopt;
  const std::size_t more = off.size() > kNamed ? off.size() - kNamed : 0;
  std::string names;
  for (std::size_t i = 0; i < off.size() - more; ++i) names += (i == 0 ? "" : ", ") + off[i].text;
  return fmt::format(
      "the robot file is not this robot's: {}{}; corrected poses land off by the difference, since the controller "
      "solves "
      "them with its own arm: compare the file with it (trammel confirm-robot)",
      names, more == 0 ? "" : fmt::format(" and {} more", more));
}

}  // namespace trammel
