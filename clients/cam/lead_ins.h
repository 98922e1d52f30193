#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/exchange/answer.h"
#include "server/robot/lead_in.h"

/// Approach points before targets that need them: chosen in one way for programs and tables.
namespace trammel::cam {

struct LeadInOptions {
  std::vector<TakeUp> take_ups;  ///< that the model knows of
  /// True for a target that is near enough without.
  std::function<bool(const exchange::CorrectedTarget&)> near_enough;
};

/// What a target that is not near enough got; both are empty where it is near enough.
struct LeadInFound {
  std::optional<LeadIn> way;
  std::string why_not;
};

/// True if the target has a pose to command.
[[nodiscard]] bool is_answered(const exchange::CorrectedTarget& item);

/// `found: why_not` behind what a row says already.
void tell_no_lead_in(const LeadInFound& found, std::string& message);

/// Corrects targets with one tool and payload. All answers of one program come from one model.
using AskCorrections = std::function<Result<exchange::Answer<exchange::CorrectedTarget>>(
    const std::string& tool, const std::string& payload,
    const std::vector<exchange::AskedTarget>& targets)>;

/// The same with the tool and payload that are agreed.
using AskTargets = std::function<Result<std::vector<exchange::CorrectedTarget>>(
    const std::vector<exchange::AskedTarget>& targets)>;
/// The way to a target of these, or why there is none.
using FindWay = std::function<LeadInFound(std::size_t, const exchange::CorrectedTarget&)>;

/// Asks once more for targets that are not near enough, as if each were led in to. Where that
/// brings it nearer by a tenth at least, the answer is taken into `items` and its way is told.
[[nodiscard]] Result<std::vector<LeadInFound>> lead_in_where_needed(
    const LeadInOptions& options, const std::vector<exchange::AskedTarget>& targets,
    const AskTargets& ask, const FindWay& find_way, std::vector<exchange::CorrectedTarget>& items);

}  // namespace trammel::cam
