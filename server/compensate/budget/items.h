#pragma once

#include <string>
#include <vector>

#include "server/compensate/budget/budget.h"
#include "server/compensate/model_parts.h"
#include "server/error_sources/physical_model.h"

/// Inside of the room: the lines that a physical model has, and where their numbers stand among its
/// parameters.
namespace trammel {

struct BudgetItem {
  BudgetLine line;                   ///< with `line`, `kind`, `cause`, `joint` and `name`
  std::size_t source = 0;            ///< in PhysicalModel::sources
  std::vector<Eigen::Index> places;  ///< of its parameters, among the model's
  bool whole_source = false;  ///< the item is the complete source: without it the source is absent
};

/// For people: `the length of link 3 (a3)`.
[[nodiscard]] std::string name_of_link_parameter(const std::string& parameter, const Chain& robot);

/// The lines of a model. The lengths of a link (a, d) are one line, and so are its angles (alpha,
/// beta). Sources that move no tool (anchors, zeros of instruments) have no line. The links' own
/// weights (`self_weight`) act through the gearboxes and are counted in their lines.
[[nodiscard]] std::vector<BudgetItem> items_of(const PhysicalModel& model);

/// The model as it would be if this line were on its drawing.
[[nodiscard]] PhysicalModel without(const PhysicalModel& model, const BudgetItem& item);
/// The model without the sources that change the load of the arm (payload, balancer). Their effects
/// are counted in their own lines, so the lines of the gearboxes must not contain them.
[[nodiscard]] PhysicalModel with_told_load(const PhysicalModel& model);
/// True if the source changes the load of the arm (payload, balancer).
[[nodiscard]] bool changes_load(const ErrorSource& source);
/// The model with the load of another model's arm: the payloads of its cell, and its sources that
/// change the load.
[[nodiscard]] PhysicalModel with_load_of(const PhysicalModel& model, const PhysicalModel& other);
/// The arm in its present state: zeros that were lost during the measurement count as zeros of its
/// links, if it has these. It predicts the same for future poses.
struct ArmOfNow {
  PhysicalModel physics;
  std::vector<IdentifiedParameter> parameters;
  Eigen::MatrixXd covariance;  ///< P x P, SI
};
[[nodiscard]] ArmOfNow arm_of_now(const ModelParts& parts);
/// True for a zero that a joint lost during the measurement.
[[nodiscard]] bool is_lost_zero(const CauseRecord& cause);

/// The place of `item` in with_told_load().
[[nodiscard]] BudgetItem in_told_load(const PhysicalModel& model, const BudgetItem& item);

}  // namespace trammel
