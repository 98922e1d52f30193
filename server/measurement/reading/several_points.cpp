#include "server/measurement/reading/several_points.h"

#include <algorithm>
#include <utility>

#include "server/base/units.h"
#include "server/measurement/pose_groups.h"

namespace trammel::reading {

namespace {

constexpr double kFarApart = 10e-3;  // m: no arm has so bad a repeatability
constexpr std::size_t kFewestApart = 3;

}  // namespace

std::optional<Error> doubt_of_several_points(const NumberTable& table) {
  struct Apart {
    std::size_t repeated = 0, apart = 0;
    double worst = 0;
    int first = 0, second = 0;
    [[nodiscard]] bool is_told() const { return apart >= kFewestApart && 2 * apart > repeated; }
  };
  Apart next, any;
  for (const PoseGroup& rows : pose_groups(table.q.transpose())) {
    double far = -1, far_next = -1;
    for (std::size_t k = 1; k < rows.size(); ++k) {
      const Measurement &before = *table.from[static_cast<std::size_t>(rows[k - 1])],
                        &row = *table.from[static_cast<std::size_t>(rows[k])];
      if (row.context.tool != before.context.tool) continue;
      const double distance = (row.p_W - before.p_W).norm();
      far = std::max(far, distance);
      if (rows[k] == rows[k - 1] + 1) far_next = std::max(far_next, distance);
      if (distance > any.worst) any.worst = distance, any.first = before.row, any.second = row.row;
    }
    for (auto& [all, farthest] : {std::pair(&next, far_next), std::pair(&any, far)}) {
      all->repeated += farthest >= 0 ? 1 : 0;
      all->apart += farthest > kFarApart ? 1 : 0;
    }
  }
  const bool are_most_repeated = 3 * any.repeated > table.size();
  if (!next.is_told() && !(are_most_repeated && any.is_told())) return std::nullopt;
  return refused(
             "at {} of {} joint vectors that several rows have, their positions are far apart, by "
             "up to {:.1f} mm in rows {} and {}: they would be several points of the tool",
             any.apart, any.repeated, to_mm(any.worst), any.first, any.second)
      .of("tool_id")
      .at_row(any.first)
      .beyond(to_mm(any.worst), to_mm(kFarApart))
      .with_text("several points of the tool")
      .next(
          "several reflectors? name in tool_id which one each row is of, and in the cell file "
          "each of them as a tool (null: unknown). Was the tracker moved in between? name each "
          "set-up in session_id")
      .value();
}

}  // namespace trammel::reading
