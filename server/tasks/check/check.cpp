#include "server/tasks/check/check.h"

#include <utility>

#include "server/robot/cell_rules.h"

namespace trammel {

Result<HealthCheck> check_robot(const CompensatedModel& model, const Cell& cell,
                                const CheckedBatch& batch, CheckAsked asked) {
  const CellRules rules = TRY(rules_of(cell));
  HealthOptions options;
  options.tolerance = asked.tolerance.value_or(rules.tolerance.value_or(kUsualTolerance));
  options.new_tool = asked.new_tool;
  options.earlier = std::move(asked.earlier);
  return check_health(model, batch, options);
}

}  // namespace trammel
