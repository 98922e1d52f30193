#include "clients/cli/service/lead_in_options.h"

#include "clients/cli/text/tolerance.h"
#include "server/base/units.h"
#include "server/compensate/take_ups.h"
#include "server/robot/cell_rules.h"

namespace trammel::cli {

Result<cam::LeadInOptions> lead_in_options(const CompensatedModel& model, double tolerance_mm) {
  const CellRules rules = TRY(rules_of(model.cell()));
  if (tolerance_mm <= 0 && !rules.tolerance) {
    return failure(ErrorCode::kUsage, "--lead-in needs a tolerance")
        .of("--lead-in")
        .next("give --tolerance MM, or tolerance_mm in the cell file");
  }
  const double limit_mm = tolerance_mm > 0 ? tolerance_mm : to_mm(*rules.tolerance);
  return cam::LeadInOptions{
      take_ups(model), [limit_mm](const exchange::CorrectedTarget& item) {
        return surely_inside({item.error_before_mm, item.error_after_mm, item.sigma_mm}, limit_mm);
      }};
}

}  // namespace trammel::cli
