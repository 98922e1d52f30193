#include "server/error_sources/error_source.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <random>

#include "server/base/units.h"
#include "server/error_sources/catalogue.h"
#include "server/error_sources/joint_map.h"
#include "server/error_sources/physical_model.h"
#include "server/error_sources/spelling.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

std::shared_ptr<const Cell> cell_7_source() {
  return std::make_shared<const Cell>(
      *read_cell(std::string(TRAMMEL_SOURCE_DIR) + "/config/cell-7.yaml"));
}

PoseContext some_pose(const Cell& cell, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> angle(-1, 1);
  PoseContext context;
  context.q.resize(cell.robot.size());
  for (int i = 0; i < cell.robot.size(); ++i) {
    context.q(i) = angle(random) + (cell.robot.joint(i).type == JointType::kPrismatic ? 2 : 0);
    context.direction.push_back(i % 2 == 0 ? 1 : -1);
  }
  context.tool = "spindle";
  context.payload = "spindle";
  context.time = 5000;
  context.temperature = 26.5;
  context.velocity = JointVector::LinSpaced(cell.robot.size(), -0.5, 0.7);
  context.before = JointVector::Constant(cell.robot.size(), 0.2);
  for (const double lag : kHeatLags) context.lagged.push_back(22 + 3 * std::exp(-lag / 3000));
  context.index = 3;
  return context;
}

std::shared_ptr<const Cell> cell_on_a_rail_source() {
  auto cell = std::make_shared<Cell>(*cell_7_source());
  cell->robot =
      *read_robot(std::string(TRAMMEL_SOURCE_DIR) + "/models/abb_irb6640-205-275-on-rail.yaml");
  cell->joint_ranges.clear();
  return cell;
}

/// One of every form of every cause that `cell` can have, of the first joint that can have it; some
/// causes want numbers.
std::vector<std::string> specs_of(const Cell& cell) {
  std::vector<std::string> specs;
  for (const CauseRecord* record : all_causes()) {
    for (const causes::Form& form : record->forms) {
      const bool of_joint = record->scope == causes::Scope::kJoint;
      const std::string at = record->lasting == causes::Lasting::kFromAPose ? "@2" : "";
      for (int k = 0; k < (of_joint ? 2 * cell.robot.size() : 1); ++k) {
        const int joint = k < 2 ? 2 : k < 4 ? 1 : k / 2 + 1;  // an upright axis feels no weight
        const std::string which = of_joint ? fmt::format(":{}", joint) : "";
        const std::string spec =
            fmt::format("{}{}{}", form.spelling, which, k % 2 == 1 ? "@40" : at);
        if (!make_error_source(spec, cell)) continue;
        specs.push_back(spec);
        break;
      }
    }
  }
  return specs;
}

/// The specifications of cell-7; and some that say more.
const std::vector<std::string>& every_spec() {
  static const std::vector<std::string> kSpecs = [] {
    std::vector<std::string> specs = {
        "gear_transmission:3@40.5+81", "joint_map:6@5",  "joint_map:5@3+150+2+1", "link_bending:4",
        "joint_coupling:3@2",          "cable_pull:4@6", "axis_runout:4",         "axis_runout:1",
        "loaded_ripple:3@40.5+81"};
    for (const std::string& spec : specs_of(*cell_7_source())) specs.push_back(spec);
    return specs;
  }();
  return kSpecs;
}

/// The specifications of a robot on a rail alone.
const std::vector<std::string>& rail_specs() {
  static const std::vector<std::string> kSpecs = [] {
    std::vector<std::string> specs = specs_of(*cell_on_a_rail_source());
    std::erase_if(specs, [](const std::string& spec) {
      return make_error_source(spec, *cell_7_source()).has_value();
    });
    return specs;
  }();
  return kSpecs;
}

/// Values as large as real ones, so that second-order terms would show.
Eigen::VectorXd plausible_values(const PhysicalModel& model, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0.2, 0.9);
  Eigen::VectorXd values = model.prior_values();
  const std::vector<Parameter> parameters = model.parameters();
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    values(static_cast<Eigen::Index>(i)) += unit(random) * parameters[i].prior_scale;
  }
  return values;
}

void expect_exact_derivatives(const std::shared_ptr<const Cell>& cell,
                              const std::vector<std::string>& specs) {
  const PhysicalModel model = *make_physical_model(cell, specs);
  const Eigen::VectorXd values = plausible_values(model, 5);
  const PoseContext context = some_pose(*cell, 6);
  Eigen::MatrixXd J;
  model.pose_W(context, values, &J);
  const std::vector<Parameter> parameters = model.parameters();
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const double step = 1e-3 * parameters[static_cast<std::size_t>(i)].prior_scale;
    Eigen::VectorXd ahead = values;
    Eigen::VectorXd behind = values;
    ahead(i) += step;
    behind(i) -= step;
    const Vector6 change = pose_difference(model.pose_W(context, ahead, nullptr),
                                           model.pose_W(context, behind, nullptr)) /
                           (2 * step);
    EXPECT_LT((J.col(i) - change).norm(), 1e-6 * (1 + change.norm()))
        << specs.back() << " of " << specs.size() << ", "
        << parameters[static_cast<std::size_t>(i)].name;
  }
}

TEST(ErrorSources, EveryJacobianFitsCentralDifferencesAloneAndTogether) {
  const auto cell = cell_7_source();
  std::vector<std::vector<std::string>> lists;
  for (const std::string& spec : every_spec()) lists.push_back({spec});
  for (const char* compliance :
       {"compliance_first_order", "compliance_equilibrium", "compliance_linear"}) {
    std::vector<std::string> all = {compliance};
    for (const std::string& spec : every_spec()) {
      if (!spec.starts_with("compliance")) all.push_back(spec);
    }
    lists.push_back(all);
  }
  for (const auto& specs : lists) expect_exact_derivatives(cell, specs);
}

TEST(ErrorSources, JacobiansOfARailFitCentralDifferencesAloneAndTogether) {
  const auto cell = cell_on_a_rail_source();
  std::vector<std::string> all = {"compliance", "geometry", "base"};
  for (const std::string& spec : rail_specs()) {
    expect_exact_derivatives(cell, {spec});
    all.push_back(spec);
  }
  for (const char* beyond : {"axis_runout:2", "axis_runout:3", "instrument_scale"})
    all.emplace_back(beyond);
  expect_exact_derivatives(cell, all);
}

/// Cell-7 with joint 3 counted the other way and coupled to joint 2.
std::shared_ptr<const Cell> coupled_cell(CouplingKind kind) {
  auto cell = std::make_shared<Cell>(*cell_7_source());
  std::vector<Joint> joints;
  for (int j = 0; j < cell->robot.size(); ++j) joints.push_back(cell->robot.joint(j));
  joints[2].sign = -1;
  cell->robot = *Chain::make("coupled", joints, {{2, 1, -1.0, kind}});
  return cell;
}

TEST(ErrorSources, JacobiansOfCoupledJointsFitCentralDifferencesAloneAndTogether) {
  for (const CouplingKind kind : {CouplingKind::kController, CouplingKind::kParallelogram}) {
    const auto cell = coupled_cell(kind);
    for (const std::string& spec : every_spec()) expect_exact_derivatives(cell, {spec});
    for (const char* compliance :
         {"compliance_first_order", "compliance_equilibrium", "compliance_linear"}) {
      std::vector<std::string> all = {compliance};
      for (const std::string& spec : every_spec())
        if (!spec.starts_with("compliance")) all.push_back(spec);
      expect_exact_derivatives(cell, all);
    }
  }
}

TEST(ErrorSources, ThreeFormsOfComplianceAgreeToFirstOrderAndDifferBySquares) {
  const auto cell = cell_7_source();
  const PoseContext context = some_pose(*cell, 7);
  const auto deflected = [&](const char* form, double stiffness_factor) {
    PhysicalModel model = *make_physical_model(cell, {form});
    model.values.setConstant(from_rad_per_nmm(2e-9) * stiffness_factor);
    return Vector3(model.pose_W(context).translation() -
                   model.nominal_pose_W(context).translation());
  };
  for (const char* form : {"compliance_equilibrium", "compliance_linear"}) {
    const double soft = (deflected(form, 1) - deflected("compliance_first_order", 1)).norm();
    const double stiff = (deflected(form, 0.1) - deflected("compliance_first_order", 0.1)).norm();
    EXPECT_GT(soft, 1e-6) << form;              // a micrometre and more: worth telling apart
    EXPECT_NEAR(soft / stiff, 100, 5) << form;  // quadratic in the compliance
    EXPECT_LT(soft, 0.02 * deflected(form, 1).norm());
  }
}

TEST(ErrorSources, WithoutValuesTheModelIsNominal) {
  const auto cell = cell_7_source();
  const PhysicalModel model =
      *make_physical_model(cell, {"base", "geometry", "compliance", "tool"});
  const PoseContext context = some_pose(*cell, 8);
  EXPECT_LT(pose_difference(model.pose_W(context), model.nominal_pose_W(context)).norm(), 1e-12);
}

TEST(ErrorSources, GeometryHasTheParametersOfTheSource) {
  const PhysicalModel model = *make_physical_model(cell_7_source(), {"geometry"});
  std::string names;
  for (const Parameter& parameter : model.parameters()) names += parameter.name + " ";
  EXPECT_EQ(names,
            "q1 d1 a1 alpha1 q2 a2 alpha2 beta2 q3 d3 a3 alpha3 q4 d4 a4 alpha4 q5 d5 a5 alpha5 q6 "
            "d6 a6 alpha6 ");
}

TEST(ErrorSources, EveryKnownCauseIsTestedHere) {
  for (const std::string& cause : known_causes()) {
    std::vector<std::string> tested = every_spec();
    tested.insert(tested.end(), rail_specs().begin(), rail_specs().end());
    EXPECT_TRUE(std::any_of(tested.begin(), tested.end(), [&](const std::string& spec) {
      return spec.substr(0, spec.find_first_of(":@")) == cause;
    })) << cause;
  }
}

void expect_to_move_the_tool(const std::shared_ptr<const Cell>& cell, const std::string& spec) {
  const std::vector<std::string> list = spec.starts_with("compliance")
                                            ? std::vector<std::string>{spec}
                                            : std::vector<std::string>{"compliance", spec};
  PhysicalModel loaded = *make_physical_model(cell, list);
  loaded.values = plausible_values(loaded, 9);
  PhysicalModel without = loaded;
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : loaded.sources) {
    const auto count = static_cast<Eigen::Index>(source->parameters().size());
    if (source->name() == spec) {
      EXPECT_FALSE(source->explanation().empty()) << spec;
      for (Eigen::Index k = 0; k < count; ++k)
        without.values(first + k) = source->parameters()[static_cast<std::size_t>(k)].prior;
    }
    first += count;
  }
  const PoseContext context = some_pose(*cell, 10);
  EXPECT_GT((loaded.pose_W(context).translation() - without.pose_W(context).translation()).norm(),
            1e-6)
      << spec;
}

TEST(ErrorSources, EveryCauseMovesTheToolAndExplainsItself) {
  for (const std::string& spec : every_spec()) expect_to_move_the_tool(cell_7_source(), spec);
  for (const std::string& spec : rail_specs())
    expect_to_move_the_tool(cell_on_a_rail_source(), spec);
}

/// What belongs to the measuring or to what nobody knows of a request.
TEST(ErrorSources, NothingServedHasWhatBelongsToTheInstrument) {
  const auto cell = cell_7_source();
  for (const char* spec :
       {"tracker_drift", "tracker_moved@2", "instrument_scale", "early_reading"}) {
    PhysicalModel model = *make_physical_model(cell, {spec});
    model.values = plausible_values(model, 11);
    PoseContext context = some_pose(*cell, 12);
    context.served = true;
    EXPECT_LT(pose_difference(model.pose_W(context), model.nominal_pose_W(context)).norm(), 1e-12)
        << spec;
  }
}

TEST(ErrorSources, AnUnknownPoseBeforeHasNoEffect) {
  const auto cell = cell_7_source();
  for (const char* spec : {"hysteresis:2", "early_reading"}) {
    PhysicalModel model = *make_physical_model(cell, {spec});
    model.values = plausible_values(model, 11);
    PoseContext context = some_pose(*cell, 12);
    context.before.reset();
    EXPECT_LT(pose_difference(model.pose_W(context), model.nominal_pose_W(context)).norm(), 1e-12)
        << spec;
  }
}

TEST(ErrorSources, AGearboxFollowsTheTemperatureWithItsOwnLag) {
  const auto cell = cell_7_source();
  PhysicalModel model = *make_physical_model(cell, {"thermal_zero:1"});
  PoseContext context = some_pose(*cell, 14);
  const auto turned = [&](double lag) {
    model.values << 1e-5, lag;
    return rotation_log(model.pose_W(context).linear() *
                        model.nominal_pose_W(context).linear().transpose())
        .z();
  };
  EXPECT_NEAR(turned(kHeatLags[4]), 1e-5 * (context.lagged[4] - 20), 1e-12);
  EXPECT_NEAR(turned(1), 1e-5 * (context.lagged.front() - 20), 1e-12);
  EXPECT_NEAR(turned(1e6), 1e-5 * (context.lagged.back() - 20), 1e-12);
  context.lagged.clear();  // nobody knows what was before: the thermometer's
  EXPECT_NEAR(turned(1000), 1e-5 * (*context.temperature - 20), 1e-12);
}

TEST(ErrorSources, AStepBeginsAtItsPose) {
  const auto cell = cell_7_source();
  for (const char* spec : {"tracker_moved@4", "tool_changed@4", "joint_slip:2@4"}) {
    PhysicalModel model = *make_physical_model(cell, {spec});
    model.values = plausible_values(model, 11);
    PoseContext context = some_pose(*cell, 12);
    context.index = 2;  // the third pose
    EXPECT_LT(pose_difference(model.pose_W(context), model.nominal_pose_W(context)).norm(), 1e-12)
        << spec;
    context.index = 3;
    EXPECT_GT(pose_difference(model.pose_W(context), model.nominal_pose_W(context)).norm(), 1e-5)
        << spec;
  }
}

TEST(ErrorSources, AJointWithPlayHangsBackFromWhereItIsGoing) {
  const auto cell = cell_7_source();
  PhysicalModel model = *make_physical_model(cell, {"backlash:1"});
  model.values(0) = 1e-4;
  PoseContext context = some_pose(*cell, 14);
  const auto reached = [&](int sense) {
    context.direction = {sense, 0, 0, 0, 0, 0};
    return rotation_log(model.pose_W(context).linear() *
                        model.nominal_pose_W(context).linear().transpose());
  };
  // Joint 1 turns about the base's z axis.
  EXPECT_LT((reached(1) - Vector3(0, 0, -1e-4)).norm(), 1e-9);
  EXPECT_LT((reached(-1) - Vector3(0, 0, 1e-4)).norm(), 1e-9);
}

TEST(ErrorSources, BendingIsTheCantileverOfTheTextbook) {
  // Link 2 level, load at its end: F l^3 / 3EI down, slope F l^2 / 2EI, plus the moment of the
  // load's lever beyond the end.
  auto cell = std::make_shared<Cell>(*cell_7_source());
  PhysicalModel model = *make_physical_model(cell, {"link_bending:2"});
  model.values(0) = 1e-6;
  PoseContext context = some_pose(*cell, 13);
  context.q = JointVector::Zero(6);
  context.q(1) = kPi / 2;   // link 2 forward
  context.q(2) = -kPi / 2;  // forearm up: what hangs beyond stands above the elbow's end
  const double length = 1.280;
  const double force = 100 * kGravity;
  const Pose X_WF = cell->robot.flange_pose(context.q);
  const Vector3 cog = X_WF * cell->payloads.at("spindle").p_FoCog_F;
  const Vector3 end = (Vector3() << 0.320 + length, 0, 0.780).finished();
  const double moment = force * (cog.x() - end.x());
  const double deflection =
      force * std::pow(length, 3) / 3 * 1e-6 + moment * length * length / 2 * 1e-6;
  const double slope = force * length * length / 2 * 1e-6 + moment * length * 1e-6;
  const Vector3 tip = model.nominal_pose_W(context).translation();
  const Vector3 expected = Vector3(0, 0, -deflection) + Vector3(0, slope, 0).cross(tip - end);
  EXPECT_LT((model.pose_W(context).translation() - tip - expected).norm(), 1e-9);
}

TEST(ErrorSources, LevelsAreListsOfSources) {
  using List = std::vector<std::string>;
  EXPECT_EQ(*parse_level("M0"), List{});
  EXPECT_EQ(*parse_level("M1"), List{"base"});
  EXPECT_EQ(*parse_level("M3"), (List{"base", "geometry", "compliance"}));
  EXPECT_EQ(*parse_level("M2, tool"), (List{"base", "geometry", "tool"}));
  EXPECT_FALSE(parse_level(""));
  EXPECT_FALSE(parse_level("M2,,tool"));
  EXPECT_FALSE(parse_level("M2,base"));
}

TEST(ErrorSources, AStarStandsForEveryJointThatCanHaveTheSource) {
  const auto names = [](const std::string& robot, const std::string& spec) {
    auto cell = std::make_shared<Cell>(*cell_7_source());
    cell->robot = *read_robot(std::string(TRAMMEL_SOURCE_DIR) + "/models/" + robot);
    std::string all;
    const auto model = make_physical_model(cell, {spec});
    if (!model) return model.error().message;
    for (const ErrorSourcePtr& source : model->sources) all += source->name() + " ";
    return all;
  };
  EXPECT_EQ(names("abb_irb6640-205-275.yaml", "joint_map:*@5"),
            "joint_map:1@5 joint_map:2@5 joint_map:3@5 joint_map:4@5 joint_map:5@5 joint_map:6@5 ");
  EXPECT_TRUE(names("abb_irb6640-205-275-on-rail.yaml", "joint_map:*")
                  .starts_with("joint_map:2 joint_map:3 "));
  EXPECT_FALSE(make_physical_model(cell_7_source(), {"geometry:*"}));
  EXPECT_FALSE(make_physical_model(cell_7_source(), {"joint_map:*", "joint_map:2"}));
}

TEST(ErrorSources, AMapIsSpelledWithItsSpectrumAndReadAgain) {
  const auto cell = cell_7_source();
  EXPECT_EQ(spelled_map(1, {.harmonics = 110, .amplitude = 312.54e-6, .knee = 1.84, .power = 1.02}),
            "joint_map:2@110+312.5+1.840+1.020");
  // An exponent would be read as another number.
  for (const double size : {1e-9, 3e-4, 0.9}) {
    const MapSpectrum spectrum{.harmonics = 9, .amplitude = size, .knee = 3, .power = 1.5};
    const ErrorSourcePtr map = *make_error_source(spelled_map(0, spectrum), *cell);
    ASSERT_EQ(map->parameters().size(), 18U);
    for (int h = 1; h <= 9; ++h)
      EXPECT_NEAR(map->parameters()[2 * static_cast<std::size_t>(h) - 1].prior_scale,
                  size * std::pow(1 + h * h / 9.0, -0.75), 1e-3 * size);
  }
  // Whatever is learned can be read.
  for (const double wild : {1e-30, 1e30}) {
    const MapSpectrum spectrum{
        .harmonics = 500, .amplitude = wild, .knee = 1 / wild, .power = wild};
    const Result<ErrorSourcePtr> map = make_error_source(spelled_map(0, spectrum), *cell);
    ASSERT_TRUE(map) << spelled_map(0, spectrum);
    EXPECT_GT((*map)->parameters().back().prior_scale, 0);
  }
  // The meaning that a model of before gives it.
  const ErrorSourcePtr before = *make_error_source("joint_map:3", *cell);
  ASSERT_EQ(before->parameters().size(), 96U);
  EXPECT_EQ(before->parameters()[95].prior_scale, 3e-4 / 65);
}

TEST(ErrorSources, AMapIsOpenWhereNothingIsToldOfItsSpectrum) {
  EXPECT_EQ(joint_of_open_map("joint_map:2"), 1);
  for (const char* told :
       {"joint_map:2@48", "joint_map:2@48+300+6+2", "joint_map:x", "joint_map", "backlash:2"})
    EXPECT_FALSE(joint_of_open_map(told)) << told;
  EXPECT_EQ(as_listed("joint_map:2@110+300+6+2", {"base", "joint_map:2"}), "joint_map:2");
  EXPECT_EQ(as_listed("joint_map:2@110+300+6+2", {"base", "joint_map:3"}),
            "joint_map:2@110+300+6+2");
  EXPECT_EQ(as_listed("joint_map:2@110", {"base", "joint_map:2"}), "joint_map:2@110");
}

TEST(ErrorSources, FormerNamesAreReadAsThePresentOnes) {
  EXPECT_EQ((*make_error_source("link_weights", *cell_7_source()))->name(), "self_weight");
  EXPECT_EQ((*make_error_source("base_yielding", *cell_7_source()))->name(), "base_compliance");
}

TEST(ErrorSources, UnknownNamesAreRefusedWithTheKnownOnes) {
  const auto cell = cell_7_source();
  const Result<ErrorSourcePtr> unknown = make_error_source("gremlins", *cell);
  ASSERT_FALSE(unknown);
  EXPECT_EQ(refusal_of(unknown),
            Refusal("", {}, "error_sources").of(ErrorCode::kUsage).text("gremlins"));
  for (const char* spec :
       {"geometry:3", "backlash", "backlash:7", "backlash:x", "tracker_moved", "tracker_moved@1.5",
        "gear_transmission:3@-4", "gear_transmission:3@", "base@3", "joint_map:2@4.5",
        "joint_map:2@9+300", "joint_map:2@9+300+6+51", "joint_map:2@9+300+0.001+2",
        "joint_map:2@9+2e6+6+2"}) {
    EXPECT_FALSE(make_error_source(spec, *cell)) << spec;
  }
}

}  // namespace
}  // namespace trammel
