#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/exchange/answer.h"
#include "server/robot/lead_in.h"

/// Approach points before targets that need them. Programs and tables use the same choice.
namespace trammel::cam {

struct LeadInOptions {
  std::vector<TakeUp> take_ups;  ///< of the joints whose play or hysteresis the model knows
  /// True for a target that is near enough without a lead-in.
  std::function<bool(const exchange::CorrectedTarget&)> near_enough;
};

/// The lead-in of a target that is not near enough, or the reason why it has none. Both are empty
/// for a target that is near enough.
struct LeadInFound {
  std::optional<LeadIn> way;
  std::string why_not;
};

/// True if the target has a pose to command.
[[nodiscard]] bool is_answered(const exchange::CorrectedTarget& item);

/// Adds `found: why_not` to the text of a row.
void tell_no_lead_in(const LeadInFound& found, std::string& message);

/// Corrects targets with one tool and payload. All answers of one program come from one model.
using AskCorrections = std::function<Result<exchange::Answer<exchange::CorrectedTarget>>(
    const std::string& tool, const std::string& payload,
    const std::vector<exchange::AskedTarget>& targets)>;

/// The same with the tool and payload that are agreed.
using AskTargets = std::function<Result<std::vector<exchange::CorrectedTarget>>(
    const std::vector<exchange::AskedTarget>& targets)>;
/// The way to a target of these, or the reason why there is none.
using FindWay = std::function<LeadInFound(std::size_t, const exchange::CorrectedTarget&)>;

/// Corrects again the targets that are not near enough, as if each had a lead-in. If that reduces
/// the error by at least a tenth, the answer replaces the one in `items`, and its way is returned.
[[nodiscard]] Result<std::vector<LeadInFound>> lead_in_where_needed(
    const LeadInOptions& options, const std::vector<exchange::AskedTarget>& targets,
    const AskTargets& ask, const FindWay& find_way, std::vector<exchange::CorrectedTarget>& items);

}  // namespace trammel::cam
