#include "server/dds/handlers.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>

#include "idl/exchange/wire_values.h"
#include "server/base/units.h"
#include "server/compensate/exchanged.h"
#include "server/dds/codec.h"
#include "server/dds/reply_memory.h"
#include "tests/dds/answered.h"
#include "tests/dds/backend.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
const wire::Joints kJoints = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};

class HandlersTest : public testing::Test {
 protected:
  wire::PredictErrorRequest predict_request(int count = 1) const {
    wire::PredictErrorRequest request;
    request.about().cell("cell-7");
    request.poses(
        std::vector<wire::CommandedJoints>(static_cast<std::size_t>(count), commanded(kJoints)));
    return request;
  }
  static wire::Approach unknown_approach() {
    wire::Approach approach;
    approach.temperature_c(kNaN);
    approach.time_s(kNaN);
    return approach;
  }
  static wire::CommandedJoints commanded(const wire::Joints& joints) {
    wire::CommandedJoints pose;
    pose.joints_rad(joints);
    pose.approach(unknown_approach());
    return pose;
  }
  wire::CorrectTargetRequest correct_request() const {
    wire::CorrectTargetRequest request;
    request.about().cell("cell-7");
    wire::Target target;
    target.kind(wire::TARGET_JOINTS);
    target.joints_rad(kJoints);
    target.approach(unknown_approach());
    request.targets({target});
    return request;
  }
  wire::SubmitMeasurementsRequest submit_request(const std::string& batch) const {
    wire::SubmitMeasurementsRequest request;
    request.header().request_id().sequence_number(5);
    request.about().cell("cell-7");
    request.batch_id(batch);
    request.csv(test::small_batch_csv(*backend_.cell, {}));
    return request;
  }
  wire::ManageModelsRequest manage_request(wire::ManageAction action, int version = 0) const {
    wire::ManageModelsRequest request;
    request.about().cell("cell-7");
    request.change().expected_version(-1);
    request.action(action);
    request.version(version);
    return request;
  }
  wire::ReadModelsRequest read_request(wire::ReadKind what, int version = 0) const {
    wire::ReadModelsRequest request;
    request.about().cell("cell-7");
    request.what(what);
    request.version(version);
    return request;
  }
  wire::ReleaseBatchesRequest release_request(wire::ReleaseAction action,
                                              std::vector<std::string> batches) const {
    wire::ReleaseBatchesRequest request;
    request.about().cell("cell-7");
    request.change().expected_version(-1);
    request.action(action);
    request.batch_ids(std::move(batches));
    return request;
  }
  std::string request_payload() const {
    return backend_.cell->payloads.empty() ? "" : backend_.cell->payloads.begin()->first;
  }
  template <typename Request>
  Refusal refusal(const Request& request) {
    return refusal_of(handlers_.answer(request));
  }

  test::Backend backend_;
  Handlers handlers_{*backend_.trainer, *backend_.store, backend_.registry};
};

TEST_F(HandlersTest, PredictAnswersFromTheModelInForceAndNamesIt) {
  const auto served = backend_.serve(3);
  const auto reply = handlers_.answer(predict_request(2));
  ASSERT_TRUE(reply) << reply.error().message;
  ASSERT_EQ(reply->predictions().size(), 2u);
  EXPECT_NEAR(reply->predictions()[1].dx_mm(), 0.3, 1e-9);
  EXPECT_NEAR(reply->predictions()[1].predicted().x_mm() - reply->predictions()[1].nominal().x_mm(),
              0.3, 1e-9);
  EXPECT_EQ(reply->model().version(), 3);
  EXPECT_EQ(reply->model().hash(), served->model.provenance().hash);
  EXPECT_TRUE(reply->model().in_force());
  EXPECT_GT(reply->model().training_age_s(), 0);
  EXPECT_TRUE(std::isnan(reply->model().data_age_s())) << "nobody recorded it";
}

TEST_F(HandlersTest, AnEmptyRequestIsAnsweredEmpty) {
  backend_.serve(1);
  const auto reply = handlers_.answer(predict_request(0));
  ASSERT_TRUE(reply) << reply.error().message;
  EXPECT_TRUE(reply->predictions().empty());
  EXPECT_EQ(reply->model().version(), 1);
}

TEST_F(HandlersTest, ACellWithoutModelIsNotAnswered) {
  EXPECT_EQ(refusal(predict_request()),
            Refusal("", {}, "cell").of(ErrorCode::kNotFound).text("cell-7"));
}

TEST_F(HandlersTest, TheContextMustFit) {
  backend_.serve(1);
  auto request = predict_request();
  request.about().cell("cell-9");
  EXPECT_EQ(refusal(request), Refusal("", {}, "cell").of(ErrorCode::kNotFound).text("cell-9"));
  request = predict_request();
  request.about().tool("gripper");
  EXPECT_EQ(refusal(request), Refusal("", {}, "tool").text("gripper"));
  request = predict_request();
  request.about().payload("anvil");
  EXPECT_EQ(refusal(request), Refusal("", {}, "payload").text("anvil"));
  request = predict_request();
  request.about().controller_compensates(true);
  EXPECT_EQ(refusal(request), Refusal("", {}, "controller_compensates"));
}

TEST_F(HandlersTest, JointsOutsideTheLimitsHaveNoPrediction) {
  backend_.serve(1);
  auto request = predict_request(2);
  request.poses()[1].joints_rad()[2] = 1.5;  // limit 70 deg
  EXPECT_EQ(refusal(request), Refusal("joint vector 2", {}, "q3_deg").beyond(85.9437, 70));
}

TEST_F(HandlersTest, ATrainedModelIsNotAskedAboutAnotherTool) {
  CompensatedModel::Parts parts = test::shifted_model(backend_.cell, 1e-4).parts();
  parts.physics.tools["probe"] = Pose::Identity();
  parts.trained_with = {{"probe", ""}};
  backend_.registry.publish(std::make_shared<const ServedModel>(
      ServedModel{"cell-7", 1, CompensatedModel::make(std::move(parts)).value()}));
  EXPECT_EQ(refusal(predict_request()), Refusal("", {}, "tool_id").text("spindle"));
  EXPECT_EQ(refusal(correct_request()), Refusal("", {}, "tool_id").text("spindle"));
}

TEST_F(HandlersTest, AModelIdMustBeTheOneInForce) {
  const auto served = backend_.serve(2);
  auto request = predict_request();
  request.about().model(served->model.provenance().id);
  EXPECT_TRUE(handlers_.answer(request));
  request.about().model(served->model.provenance().hash);
  EXPECT_TRUE(handlers_.answer(request));
  request.about().model("@2");
  EXPECT_TRUE(handlers_.answer(request));
  request.about().model("0123456789ab");
  EXPECT_EQ(refusal(request),
            Refusal("", {}, "model").of(ErrorCode::kConflict).text("0123456789ab"));
  request.about().model("@2x");
  EXPECT_EQ(refusal(request), Refusal("", {}, "model").of(ErrorCode::kConflict).text("@2x"));
}

TEST_F(HandlersTest, AStoredVersionAnswersWhenItIsNamed) {
  ASSERT_TRUE(
      backend_.store->add_model("cell-7", test::shifted_model(backend_.cell, 5e-4), 0, false, ""));
  backend_.serve(2);
  auto request = predict_request();
  request.about().model("@1");
  for (int again = 0; again < 2; ++again) {
    const auto reply = handlers_.answer(request);
    ASSERT_TRUE(reply) << reply.error().message;
    EXPECT_NEAR(reply->predictions()[0].dx_mm(), 0.5, 1e-9);
    EXPECT_EQ(reply->model().version(), 1);
    EXPECT_FALSE(reply->model().in_force());
  }
  request.about().model("@7");
  EXPECT_EQ(refusal(request), Refusal("", {}, "version").of(ErrorCode::kNotFound).value(7));
}

TEST_F(HandlersTest, WrongNumbersAreRefusedWithTheirPlace) {
  backend_.serve(1);
  auto request = predict_request(3);
  request.poses()[2].joints_rad({1, 2, 3});
  EXPECT_EQ(refusal(request), Refusal("joint vector 3", {}, "joints_rad").beyond(3, 6));
  request.poses()[2].joints_rad({1, 2, kNaN, 4, 5, 6});
  EXPECT_EQ(refusal(request), Refusal("joint vector 3", {}, "joints_rad").value(kNaN));
  request.poses()[2] = commanded(kJoints);
  request.poses()[2].approach().directions({1, 0});
  EXPECT_EQ(refusal(request), Refusal("joint vector 3", {}, "directions").beyond(2, 6));
  request.poses()[2].approach().directions({1, 0, 0, 0, 2, 0});
  EXPECT_EQ(refusal(request), Refusal("joint vector 3", {}, "directions").value(2));
  request.poses()[2].approach().directions({});
  request.poses()[2].approach().temperature_c(std::numeric_limits<double>::infinity());
  EXPECT_EQ(handlers_.answer(request).error().field, "temperature_c");

  auto correct = correct_request();
  correct.targets()[0].kind(wire::TARGET_POSE_NEAR_JOINTS);
  correct.targets()[0].pose().qw(0.5);
  EXPECT_EQ(refusal(correct), Refusal("target 1", {}, "pose").beyond(0.5, 1));
  correct.targets()[0].pose().qw(1);
  correct.targets()[0].pose().x_mm(std::numeric_limits<double>::infinity());
  EXPECT_EQ(refusal(correct), Refusal("target 1", {}, "pose"));
  correct.targets()[0].pose().x_mm(0);
  correct.targets()[0].kind(wire::TARGET_POSE_ON_BRANCH);
  correct.targets()[0].conf(8);
  EXPECT_EQ(refusal(correct), Refusal("target 1", {}, "conf").beyond(8, 7));
}

TEST_F(HandlersTest, CorrectedTargetsLandWhereTheyWereWanted) {
  backend_.serve(8);
  const auto reply = handlers_.answer(correct_request());
  ASSERT_TRUE(reply) << reply.error().message;
  ASSERT_EQ(reply->corrections().size(), 1u);
  const wire::CorrectedTarget& corrected = reply->corrections()[0];
  EXPECT_EQ(corrected.status(), wire::TARGET_OK) << corrected.message();
  EXPECT_NEAR(corrected.error_before_mm(), 0.8, 1e-6);
  const CompensatedModel& model = backend_.registry.in_force("cell-7")->model;
  const JointVector q = Eigen::Map<const JointVector>(corrected.joints_rad().data(), 6);
  const double stddev = to_mm(model.predict(q, "spindle", request_payload()).true_stddev_B.norm());
  EXPECT_NEAR(corrected.error_after_mm(), stddev, 1e-4);

  wire::PredictErrorRequest check = predict_request();
  check.poses({commanded(kJoints), commanded(corrected.joints_rad())});
  const auto there = handlers_.answer(check);
  ASSERT_TRUE(there) << there.error().message;
  EXPECT_NEAR(there->predictions()[1].predicted().x_mm(), there->predictions()[0].nominal().x_mm(),
              1e-3);
}

TEST_F(HandlersTest, ATargetLeftAloneNamesJointAndLimitAndRepeatsItsErrorBefore) {
  backend_.serve(8);
  auto request = correct_request();
  request.targets()[0].joints_rad()[2] = 1.5;  // limit 70 deg
  const auto reply = handlers_.answer(request);
  ASSERT_TRUE(reply) << reply.error().message;
  const wire::CorrectedTarget& left = reply->corrections().front();
  EXPECT_EQ(left.status(), wire::TARGET_JOINT_LIMIT);
  EXPECT_NE(left.message().find("joint 3 would be at 85.9 deg, limit 70"), std::string::npos)
      << left.message();
  EXPECT_NEAR(left.error_before_mm(), 0.8, 1e-6);
  EXPECT_EQ(left.error_after_mm(), left.error_before_mm());
  for (std::size_t j = 0; j < 6; ++j)
    EXPECT_EQ(to_deg(left.joints_rad()[j]), to_deg(request.targets()[0].joints_rad()[j])) << j;
}

TEST_F(HandlersTest, WhereNoJointsLeadNothingIsExpected) {
  backend_.serve(8);
  auto request = correct_request();
  wire::Target& target = request.targets()[0];
  target.pose().qw(1);
  for (const double far_mm : {9000.0, 1e12, 1e300}) {
    for (const auto kind : {wire::TARGET_POSE_NEAR_JOINTS, wire::TARGET_POSE_ON_BRANCH}) {
      target.kind(kind);
      target.pose().x_mm(far_mm);
      const auto reply = handlers_.answer(request);
      ASSERT_TRUE(reply) << reply.error().message;
      const wire::CorrectedTarget& left = reply->corrections().front();
      EXPECT_EQ(left.status(), wire::TARGET_UNREACHABLE) << far_mm << ": " << left.message();
      EXPECT_TRUE(std::isnan(left.error_before_mm()) && std::isnan(left.error_after_mm()))
          << far_mm;
    }
  }
}

TEST_F(HandlersTest, EveryNumberOfAPredictionIsTheModels) {
  CompensatedModel::Parts parts = test::shifted_model(backend_.cell, 1e-4).parts();
  parts.physics.values.head<3>() = Vector3(1e-4, 2e-4, 3e-4);
  parts.covariance.diagonal().head<3>() = Vector3(1e-8, 4e-8, 9e-8);
  const CompensatedModel model = CompensatedModel::make(std::move(parts)).value();
  backend_.registry.publish(std::make_shared<const ServedModel>(ServedModel{"cell-7", 1, model}));
  const auto reply = handlers_.answer(predict_request());
  ASSERT_TRUE(reply) << reply.error().message;
  const wire::PredictedError& got = reply->predictions().front();
  const ErrorPrediction expected = model.predict(Eigen::Map<const JointVector>(kJoints.data(), 6),
                                                 "spindle", predict_request().about().payload());
  EXPECT_EQ(Vector3(got.dx_mm(), got.dy_mm(), got.dz_mm()), expected.error_B * to_mm(1));
  EXPECT_EQ(Vector3(got.sx_mm(), got.sy_mm(), got.sz_mm()), expected.stddev_B * to_mm(1));
  EXPECT_NE(got.dy_mm(), got.dz_mm());
  EXPECT_NE(got.sx_mm(), got.sy_mm());
  EXPECT_EQ(got.predicted().y_mm(), to_mm(expected.X_BT_predicted.translation().y()));
  EXPECT_EQ(got.nominal().z_mm(), to_mm(expected.X_BT_nominal.translation().z()));
  EXPECT_EQ(got.in_domain(), expected.in_domain);
}

TEST_F(HandlersTest, ACorrectionByAnEarlierVersionNamesThatVersion) {
  const CompensatedModel stored = test::shifted_model(backend_.cell, 8e-4);
  ASSERT_EQ(backend_.store->add_model("cell-7", stored, 0, false, "").value_or(0), 1);
  backend_.serve(2);
  auto request = correct_request();
  request.about().model("@1");
  const auto reply = handlers_.answer(request);
  ASSERT_TRUE(reply) << reply.error().message;
  EXPECT_EQ(reply->model().version(), 1);
  EXPECT_EQ(reply->model().hash(), stored.provenance().hash);
  EXPECT_FALSE(reply->model().in_force());
  EXPECT_NEAR(reply->corrections().front().error_before_mm(), 0.8, 1e-6);
}

TEST_F(HandlersTest, SubmitStoresBeforeItAnswersAndKnowsItsRepeats) {
  const auto first = handlers_.answer(submit_request("lt-07"));
  ASSERT_TRUE(first) << first.error().message;
  EXPECT_TRUE(backend_.store->batch("cell-7", "lt-07"));
  const auto repeat = handlers_.answer(submit_request("lt-07"));
  ASSERT_TRUE(repeat) << repeat.error().message;
  EXPECT_EQ(repeat->job(), first->job());

  auto another = submit_request("lt-07");
  another.header().request_id().sequence_number(6);
  EXPECT_EQ(handlers_.answer(another)->job(), first->job())
      << "whoever lost the receipt gets it again";
  another.csv(test::small_batch_csv(*backend_.cell, {.seed = 9}));
  EXPECT_EQ(refusal(another), Refusal("", {}, "batch").of(ErrorCode::kConflict).text("lt-07"));
  EXPECT_EQ(refusal(submit_request("")), Refusal("", {}, "batch_id"));
  auto bad = submit_request("lt-08");
  bad.csv("q1_deg,x_mm\n1,2\n");
  EXPECT_EQ(refusal(bad), Refusal("batch lt-08", {}, "y_mm"));
}

TEST_F(HandlersTest, TrainQueuesWhatIsStored) {
  wire::TrainRequest request;
  request.about().cell("cell-7");
  request.change().expected_version(-1);
  EXPECT_EQ(refusal(request), Refusal("", {}, "batch").of(ErrorCode::kNotFound));
  ASSERT_TRUE(handlers_.answer(submit_request("lt-07")));
  request.batch_ids({"lt-07"});
  const auto job = handlers_.answer(request);
  ASSERT_TRUE(job) << job.error().message;
  auto look = read_request(wire::READ_JOB);
  look.job(job->job());
  const auto state = handlers_.answer(look);
  ASSERT_TRUE(state) << state.error().message;
  ASSERT_EQ(state->jobs().size(), 1u);
  EXPECT_EQ(state->jobs().front().stage(), wire::JOB_QUEUED);
  EXPECT_EQ(state->jobs().front().batch_ids(), std::vector<std::string>{"lt-07"});
  look.job(99);
  EXPECT_EQ(refusal(look), Refusal("", {}, "job").of(ErrorCode::kNotFound).value(99));
}

TEST_F(HandlersTest, ModelsAreListedActivatedRolledBackAndCarriedElsewhere) {
  for (const int version : {1, 2}) {
    ASSERT_TRUE(backend_.store->add_model(
        "cell-7", test::shifted_model(backend_.cell, version * 1e-4), 0, false, "by hand"));
  }
  EXPECT_EQ(refusal(manage_request(wire::MANAGE_ROLLBACK)),
            Refusal("", {}, "cell").of(ErrorCode::kNotFound).text("cell-7"));
  ASSERT_TRUE(handlers_.answer(manage_request(wire::MANAGE_ACTIVATE, 1)));
  ASSERT_TRUE(handlers_.answer(manage_request(wire::MANAGE_ACTIVATE, 2)));
  EXPECT_EQ(backend_.registry.in_force("cell-7")->version, 2);
  EXPECT_EQ(refusal(manage_request(wire::MANAGE_ACTIVATE, 9)),
            Refusal("", {}, "version").of(ErrorCode::kNotFound).value(9));
  const auto back = handlers_.answer(manage_request(wire::MANAGE_ROLLBACK));
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back->version(), 1);

  const auto list = handlers_.answer(read_request(wire::READ_MODELS));
  ASSERT_TRUE(list);
  ASSERT_EQ(list->models().size(), 2u);
  EXPECT_TRUE(list->models()[0].in_force());
  EXPECT_FALSE(list->models()[1].in_force());

  const auto exported = handlers_.answer(read_request(wire::READ_MODEL, 2));
  ASSERT_TRUE(exported) << exported.error().message;
  const auto in_force = handlers_.answer(read_request(wire::READ_MODEL));
  ASSERT_TRUE(in_force);
  EXPECT_EQ(in_force->version(), 1);
  EXPECT_NE(in_force->text(), exported->text());
  auto import = manage_request(wire::MANAGE_IMPORT);
  import.model_text(exported->text());
  const auto imported = handlers_.answer(import);
  ASSERT_TRUE(imported) << imported.error().message;
  EXPECT_EQ(imported->version(), 2);
  import.model_text("{}");
  EXPECT_FALSE(handlers_.answer(import));
}

TEST_F(HandlersTest, AChangeHappensOnceUnderItsIdAndOnlyWhereTheExpectedVersionIsInForce) {
  for (const int version : {1, 2, 3}) {
    ASSERT_TRUE(backend_.store->add_model(
        "cell-7", test::shifted_model(backend_.cell, version * 1e-4), 0, false, ""));
    ASSERT_TRUE(handlers_.answer(manage_request(wire::MANAGE_ACTIVATE, version)));
  }
  auto back = manage_request(wire::MANAGE_ROLLBACK);
  back.change().id("r-1");
  back.change().expected_version(3);
  EXPECT_EQ(handlers_.answer(back)->version(), 2);
  Handlers after_a_restart(*backend_.trainer, *backend_.store, backend_.registry);
  EXPECT_EQ(after_a_restart.answer(back)->version(), 2);
  EXPECT_EQ(backend_.registry.in_force("cell-7")->version, 2);
  back.change().id("r-2");
  EXPECT_EQ(handlers_.answer(back).error().code, ErrorCode::kConflict)
      << "version 3 is not in force any more";
  auto other = manage_request(wire::MANAGE_ACTIVATE, 3);
  other.change().id("r-1");
  EXPECT_EQ(handlers_.answer(other).error().code, ErrorCode::kConflict)
      << "the id is of a rollback";
  other.change().id("");
  other.change().expected_version(-2);
  EXPECT_EQ(handlers_.answer(other).error().code, ErrorCode::kUsage);

  ASSERT_TRUE(handlers_.answer(submit_request("lt-07")));
  wire::TrainRequest train;
  train.about().cell("cell-7");
  train.change().id("t-1");
  train.change().expected_version(2);
  const auto job = handlers_.answer(train);
  ASSERT_TRUE(job) << job.error().message;
  ASSERT_TRUE(handlers_.answer(manage_request(wire::MANAGE_ACTIVATE, 1)));
  EXPECT_EQ(after_a_restart.answer(train)->job(), job->job())
      << "the repeat of what was done is no conflict";
  train.change().id("t-2");
  EXPECT_EQ(handlers_.answer(train).error().code, ErrorCode::kConflict);
}

TEST_F(HandlersTest, ToActivateWhatIsInForcePublishesNothing) {
  ASSERT_TRUE(
      backend_.store->add_model("cell-7", test::shifted_model(backend_.cell, 1e-4), 0, false, ""));
  ASSERT_TRUE(handlers_.answer(manage_request(wire::MANAGE_ACTIVATE, 1)));
  const auto served = backend_.registry.in_force("cell-7");
  const auto again = handlers_.answer(manage_request(wire::MANAGE_ACTIVATE, 1));
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->version(), 1);
  EXPECT_EQ(backend_.registry.in_force("cell-7"), served);
}

TEST_F(HandlersTest, AJobIsCancelledByTheCellThatHasIt) {
  const auto job = handlers_.answer(submit_request("lt-07"));
  ASSERT_TRUE(job) << job.error().message;
  auto cancel = manage_request(wire::MANAGE_CANCEL_JOB);
  cancel.job(job->job());
  cancel.about().cell("cell-8");
  EXPECT_EQ(handlers_.answer(cancel).error().code, ErrorCode::kNotFound);
  cancel.about().cell("cell-7");
  const auto cancelled = handlers_.answer(cancel);
  ASSERT_TRUE(cancelled) << cancelled.error().message;
  auto look = read_request(wire::READ_JOB);
  look.job(job->job());
  const wire::Job state = handlers_.answer(look)->jobs().front();
  EXPECT_EQ(state.stage(), wire::JOB_CANCELLED);
  EXPECT_EQ(state.outcome().verdict(), wire::VERDICT_CANCELLED);
}

/// A model whose second joint has play, and whose links grow as they warm up.
CompensatedModel model_with_play_and_heat(const std::shared_ptr<const Cell>& cell) {
  CompensatedModel::Parts parts = test::shifted_model(cell, 0).parts();
  parts.physics = make_physical_model(cell, {"base", "thermal_growth", "backlash:2"}).value();
  parts.parameters.clear();
  const auto parameters = parts.physics.parameters();
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    double& value = parts.physics.values[static_cast<Eigen::Index>(i)];
    if (parameters[i].name == "b2") value = 1e-3;
    if (parameters[i].name == "growth") value = 2e-5;
    IdentifiedParameter identified;
    identified.parameter = parameters[i];
    identified.value = value;
    parts.parameters.push_back(identified);
  }
  parts.covariance =
      Eigen::MatrixXd::Zero(parts.physics.values.size(), parts.physics.values.size());
  parts.temperature_mean = 20;
  parts.temperature_stddev = 5;
  return CompensatedModel::make(std::move(parts)).value();
}

TEST_F(HandlersTest, TheSideAJointComesFromAndTheTemperatureReachThePhysics) {
  backend_.registry.publish(std::make_shared<const ServedModel>(
      ServedModel{"cell-7", 1, model_with_play_and_heat(backend_.cell)}));
  auto request = predict_request(4);
  request.poses()[1].approach().directions({0, 1, 0, 0, 0, 0});
  request.poses()[2].approach().directions({0, -1, 0, 0, 0, 0});
  request.poses()[3].approach().temperature_c(40);
  const auto reply = handlers_.answer(request);
  ASSERT_TRUE(reply) << reply.error().message;
  const auto z = [&](std::size_t i) { return reply->predictions()[i].predicted().z_mm(); };
  EXPECT_GT(std::abs(z(1) - z(2)), 0.5) << "a milliradian of play either way";
  EXPECT_NEAR((z(1) + z(2)) / 2, z(0), 1e-2) << "what is not said is neutral";
  EXPECT_GT(std::abs(z(3) - z(0)), 0.05);
  EXPECT_GT(reply->predictions()[0].slz_mm(), reply->predictions()[1].slz_mm())
      << "and stands in the deviation";

  auto correct = correct_request();
  correct.targets().resize(3, correct.targets().front());
  correct.targets()[1].approach().directions({0, 1, 0, 0, 0, 0});
  correct.targets()[2].approach().directions({0, -1, 0, 0, 0, 0});
  const auto corrected = handlers_.answer(correct);
  ASSERT_TRUE(corrected) << corrected.error().message;
  const auto commanded = [&](std::size_t i) {
    return corrected->corrections()[i].commanded().z_mm();
  };
  EXPECT_GT(std::abs(commanded(1) - commanded(2)), 0.5);
  EXPECT_GT(std::abs(commanded(1) - commanded(0)), 0.2);
}

TEST_F(HandlersTest, ACorrectionTellsItsOrientationAndOneMeasurementBesideTheTruth) {
  backend_.registry.publish(std::make_shared<const ServedModel>(
      ServedModel{"cell-7", 1, model_with_play_and_heat(backend_.cell)}));
  auto request = correct_request();
  request.targets()[0].approach().directions({0, 1, 0, 0, 0, 0});
  const auto reply = handlers_.answer(request);
  ASSERT_TRUE(reply) << reply.error().message;
  const wire::CorrectedTarget& corrected = reply->corrections().front();
  ASSERT_EQ(corrected.status(), wire::TARGET_OK) << corrected.message();
  EXPECT_NEAR(corrected.turn_before_rad(), 1e-3, 1e-4) << "the play turns the tool";
  EXPECT_LT(corrected.turn_after_rad(), 1e-6);
  EXPECT_NEAR(corrected.sigma_measured_mm(),
              std::hypot(corrected.sigma_mm(), to_mm(backend_.cell->tracker.sigma)), 1e-9);
}

TEST_F(HandlersTest, DiagnoseIsQueuedAndAnswersWhenItIsDone) {
  ASSERT_TRUE(handlers_.answer(submit_request("lt-07")));
  wire::DiagnoseRequest request;
  request.about().cell("cell-7");
  request.batch_id("lt-07");
  const auto queued = handlers_.answer(request);
  ASSERT_TRUE(queued) << queued.error().message;
  auto fetch = read_request(wire::READ_FINDINGS);
  fetch.job(queued->job());
  EXPECT_EQ(handlers_.answer(fetch).error().code, ErrorCode::kBusy);
  ASSERT_TRUE(backend_.store->store_findings(queued->job(), "{}", "<html>"));
  EXPECT_EQ(handlers_.answer(fetch)->text(), "{}");
  EXPECT_TRUE(handlers_.answer(fetch)->page_html().empty());
  fetch.page(true);
  EXPECT_EQ(handlers_.answer(fetch)->page_html(), "<html>");
  fetch.about().cell("cell-8");
  EXPECT_EQ(handlers_.answer(fetch).error().code, ErrorCode::kNotFound);
}

TEST_F(HandlersTest, ACheckIsQueuedAgainstTheModelInForceAndRefusedWithoutOne) {
  ASSERT_TRUE(handlers_.answer(submit_request("lt-07")));
  wire::CheckHealthRequest request;
  request.about().cell("cell-7");
  request.batch_id("lt-07");
  request.tolerance_mm(0.05);
  EXPECT_EQ(handlers_.answer(request).error().code, ErrorCode::kNotFound);
  ASSERT_TRUE(
      backend_.store->add_model("cell-7", test::shifted_model(backend_.cell, 1e-4), 0, false, ""));
  ASSERT_TRUE(handlers_.answer(manage_request(wire::MANAGE_ACTIVATE, 1)));
  const auto queued = handlers_.answer(request);
  ASSERT_TRUE(queued) << queued.error().message;
  EXPECT_EQ(backend_.store->job(queued->job())->kind(), JobKind::kCheck);
  ASSERT_TRUE(backend_.store->store_findings(queued->job(), R"({"verdict": "healthy"})", ""));
  auto fetch = read_request(wire::READ_FINDINGS);
  fetch.job(queued->job());
  EXPECT_EQ(handlers_.answer(fetch)->text(), R"({"verdict": "healthy"})");
  request.tolerance_mm(0);
  EXPECT_EQ(handlers_.answer(request).error().code, ErrorCode::kUsage);
}

TEST_F(HandlersTest, WithTheHealthOfAllCellsComesWhichServersThereAre) {
  auto request = read_request(wire::READ_HEALTH);
  request.since_unix_s(-1);
  for (const bool of_all : {true, false}) {
    request.about().cell(of_all ? "" : "cell-7");
    const auto reply = handlers_.answer(request);
    ASSERT_TRUE(reply) << reply.error().message;
    const auto servers = nlohmann::json::parse(reply->text()).at("servers");
    ASSERT_EQ(servers.is_null(), !of_all) << "one cell is asked for often";
    if (!of_all) continue;
    ASSERT_EQ(servers.size(), 1u) << "a file has one server";
    EXPECT_EQ(servers[0].at("gone"), false);
    EXPECT_EQ(servers[0].at("changes_behind"), 0);
    EXPECT_EQ(servers[0].at("cells").size(), backend_.trainer->cells().size());
  }
}

TEST_F(HandlersTest, TheHealthOfACellIsItsChecksTheNextOneAndHowWhatIsInForceWasJudged) {
  const auto read = [this](const std::string& cell, std::uint32_t most) {
    auto request = read_request(wire::READ_HEALTH);
    request.about().cell(cell);
    request.most(most);
    request.since_unix_s(-1);
    const auto reply = handlers_.answer(request);
    EXPECT_TRUE(reply) << reply.error().message;
    return nlohmann::json::parse(reply ? reply->text() : "{}").at("cells");
  };
  EXPECT_EQ(read("", 0).size(), 2u) << "every cell";
  EXPECT_TRUE(read("cell-7", 0).at(0).at("in_force").is_null());
  for (const double shift : {1e-4, 2e-4})
    ASSERT_TRUE(backend_.store->add_model("cell-7", test::shifted_model(backend_.cell, shift), 0,
                                          false, ""));
  ASSERT_TRUE(handlers_.answer(manage_request(wire::MANAGE_ACTIVATE, 1)));
  ASSERT_TRUE(handlers_.answer(manage_request(wire::MANAGE_ACTIVATE, 2)));
  const std::string model = backend_.registry.in_force("cell-7")->model.provenance().id;
  const auto checked = [this](const std::string& findings) {
    wire::CheckHealthRequest request;
    request.about().cell("cell-7");
    request.csv(test::small_batch_csv(*backend_.cell, {}));
    request.tolerance_mm(0.05);
    const auto queued = handlers_.answer(request);
    ASSERT_TRUE(queued) << queued.error().message;
    ASSERT_TRUE(backend_.store->store_findings(queued->job(), findings, ""));
    ASSERT_TRUE(backend_.store->set_job_done(queued->job(), "checked"));
  };
  checked(fmt::format(
      R"({{"verdict": "healthy", "model": "{}", "due": "2026-12-01", "rms_mm": 0.02}})", model));
  checked(fmt::format(
      R"({{"verdict": "changed", "model": "{}", "due": "", "due_because": "it changed"}})", model));
  auto health = read("cell-7", 0).at(0);
  ASSERT_EQ(health.at("checks").size(), 2u);
  EXPECT_EQ(health["checks"][0]["verdict"], "healthy");
  EXPECT_EQ(health["checks"][0]["due"], "2026-12-01");
  EXPECT_EQ(health["checks"][0]["rms_mm"], 0.02);
  EXPECT_TRUE(health["checks"][0]["tolerance_mm"].is_null());
  EXPECT_EQ(health.at("verdict"), "changed");
  EXPECT_EQ(health.at("due_because"), "it changed");
  EXPECT_EQ(health.at("in_force").at("version"), 2);
  EXPECT_EQ(health["in_force"]["version_before"], 1);
  EXPECT_NE(health["in_force"]["next"].get<std::string>().find("trammel rollback"),
            std::string::npos);
  EXPECT_EQ(read("cell-7", 1).at(0).at("checks").size(), 1u) << "the newest";
  ASSERT_TRUE(handlers_.answer(manage_request(wire::MANAGE_ROLLBACK)));
  health = read("cell-7", 0).at(0);
  EXPECT_EQ(health.at("in_force").at("version"), 1);
  EXPECT_TRUE(health.at("verdict").is_null()) << "the checks were of another model";
}

TEST_F(HandlersTest, TheFleetListsEveryCell) {
  const auto fleet = handlers_.answer(read_request(wire::READ_FLEET));
  ASSERT_TRUE(fleet) << fleet.error().message;
  EXPECT_NE(fleet->text().find("\"cell\": \"cell-7\""), std::string::npos) << fleet->text();
}

TEST_F(HandlersTest, WhatWasLatelyAskedIsReplayedWithAnotherVersion) {
  backend_.serve(3);
  const auto none = handlers_.answer(read_request(wire::READ_REPLAY));
  ASSERT_TRUE(none) << none.error().message;
  EXPECT_EQ(nlohmann::json::parse(none->text()).at("poses"), 0);
  ASSERT_TRUE(handlers_.answer(predict_request(2)));
  const auto version =
      backend_.store->add_model("cell-7", test::shifted_model(backend_.cell, 5e-4), 0, false, "");
  ASSERT_TRUE(version) << version.error().message;
  const auto beside = handlers_.answer(read_request(wire::READ_REPLAY, *version));
  ASSERT_TRUE(beside) << beside.error().message;
  const auto json = nlohmann::json::parse(beside->text());
  EXPECT_EQ(json.at("poses"), 2);
  EXPECT_EQ(json.at("other").at("version"), *version);
  EXPECT_NEAR(json.at("difference").at("max_mm").get<double>(), 0.2, 1e-9);
  EXPECT_NEAR(json.at("difference").at("rms_mm").get<double>(), 0.2, 1e-9);
  EXPECT_TRUE(beside->in_force().in_force());
  const auto alone = handlers_.answer(read_request(wire::READ_REPLAY));
  ASSERT_TRUE(alone);
  EXPECT_TRUE(nlohmann::json::parse(alone->text()).at("difference").is_null());
  EXPECT_EQ(handlers_.answer(read_request(wire::READ_REPLAY, 77)).error().code,
            ErrorCode::kNotFound);
}

TEST_F(HandlersTest, ADiagnosisToApplyIsATrainingAndTakesOneBatch) {
  ASSERT_TRUE(handlers_.answer(submit_request("lt-07")));
  wire::TrainRequest request;
  request.about().cell("cell-7");
  request.change().expected_version(-1);
  request.kind(wire::TRAIN_DIAGNOSED);
  request.batch_ids({"lt-07"});
  const auto queued = handlers_.answer(request);
  ASSERT_TRUE(queued) << queued.error().message;
  EXPECT_TRUE(std::get<AskedDiagnosis>(backend_.store->job(queued->job())->asked).apply);
  request.batch_ids({"lt-07", "lt-08"});
  EXPECT_EQ(refusal(request), Refusal("", {}, "batch_ids").of(ErrorCode::kUsage).beyond(2, 1));
}

TEST_F(HandlersTest, BatchesAreListedAndReadAsTheyCame) {
  const std::string csv = test::small_batch_csv(*backend_.cell, {});
  ASSERT_TRUE(backend_.trainer->submit("cell-7", "lt-07", csv, "client:1"));
  auto request = read_request(wire::READ_BATCHES);
  for (const char* cell : {"cell-7", ""}) {
    request.about().cell(cell);
    const auto listed = handlers_.answer(request);
    ASSERT_TRUE(listed) << listed.error().message;
    ASSERT_EQ(listed->batches().size(), 1u);
    EXPECT_EQ(listed->batches()[0].id(), "lt-07");
    EXPECT_TRUE(listed->text().empty());
  }
  request = read_request(wire::READ_BATCH);
  request.batch_id("lt-07");
  const auto read = handlers_.answer(request);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->text(), csv);
  request.batch_id("lt-08");
  EXPECT_EQ(handlers_.answer(request).error().code, ErrorCode::kNotFound);
}

TEST_F(HandlersTest, WhatIsNotBuiltYetSaysSoAndChangesNothing) {
  ASSERT_TRUE(
      backend_.store->add_model("cell-7", test::shifted_model(backend_.cell, 1e-4), 0, false, ""));
  const auto is_unsupported = [](const auto& reply) {
    return reply && reply->header().result() == wire::RESULT_UNSUPPORTED &&
           reply->header().problems().size() == 1;
  };
  EXPECT_TRUE(is_unsupported(handlers_.answer(manage_request(wire::MANAGE_BACKUP))));
  auto forced = manage_request(wire::MANAGE_ROLLBACK);
  forced.force(true);
  EXPECT_TRUE(is_unsupported(handlers_.answer(forced)));
  wire::TrainRequest train;
  train.batch_rule("last 3");
  EXPECT_TRUE(is_unsupported(handlers_.answer(train)));
  train.batch_rule("");
  train.prior("fleet");
  EXPECT_TRUE(is_unsupported(handlers_.answer(train)));
  train.prior("");
  train.diagnosis(4);
  EXPECT_TRUE(is_unsupported(handlers_.answer(train)));
  EXPECT_EQ(backend_.registry.in_force("cell-7"), nullptr);
}

TEST_F(HandlersTest, BatchesInQuarantineAreListedAndReleased) {
  ASSERT_TRUE(handlers_.answer(submit_request("lt-07")));
  ASSERT_TRUE(backend_.store->set_quarantine("cell-7", "lt-07", "another tool"));
  auto look = read_request(wire::READ_QUARANTINE);
  look.about().cell("");
  const auto all = handlers_.answer(look);
  ASSERT_TRUE(all) << all.error().message;
  ASSERT_EQ(all->batches().size(), 1u);
  EXPECT_EQ(all->batches().front().quarantine(), "another tool");
  look.about().cell("cell-8");
  EXPECT_TRUE(handlers_.answer(look)->batches().empty());
  EXPECT_TRUE(handlers_.answer(release_request(wire::RELEASE_BATCHES, {"lt-07"})));
  look.about().cell("cell-7");
  EXPECT_TRUE(handlers_.answer(look)->batches().empty());
  EXPECT_EQ(refusal(release_request(wire::RELEASE_BATCHES, {})),
            Refusal("", {}, "batch_ids").of(ErrorCode::kUsage).beyond(0, 1));
}

TEST_F(HandlersTest, ABatchIsReleasedOnlyWithATrainingThatIsAccepted) {
  ASSERT_TRUE(handlers_.answer(submit_request("lt-07")));
  ASSERT_TRUE(backend_.store->set_quarantine("cell-7", "lt-07", "another tool"));
  auto request = release_request(wire::RELEASE_AND_TRAIN, {"lt-07"});
  request.level("M9");
  EXPECT_FALSE(handlers_.answer(request));
  EXPECT_FALSE(handlers_.answer(release_request(wire::RELEASE_AND_TRAIN, {"lt-07", "lt-99"})));
  EXPECT_FALSE(handlers_.answer(release_request(wire::RELEASE_AND_TRAIN, {})));
  EXPECT_EQ(backend_.trainer->quarantined("")->size(), 1u);
  request.level("M1");
  request.bias("none");
  const auto accepted = handlers_.answer(request);
  ASSERT_TRUE(accepted) << accepted.error().message;
  EXPECT_GT(accepted->job(), 0);
  EXPECT_EQ(std::get<AskedTraining>(backend_.store->job(accepted->job())->asked).level, "M1");
  EXPECT_TRUE(*backend_.store->may_release(accepted->job()));
  EXPECT_EQ(backend_.trainer->quarantined("")->size(), 1u) << "until its model is put in force";
  EXPECT_TRUE(happens_once(request));
}

TEST_F(HandlersTest, JobsAreListedWithStageReasonAndTimes) {
  StoredJob stored;
  stored.cell = "cell-7";
  stored.created_at = unix_now_s();
  const auto first =
      backend_.store->add_batch({"cell-7", "lt-07", "csv", "hash", "client:1", 0, 1}, stored);
  ASSERT_TRUE(first) << first.error().message;
  ASSERT_TRUE(backend_.store->set_job_running(first->id));
  ASSERT_TRUE(backend_.store->set_job_failed(first->id, "too \"few\" rows"));
  auto request = read_request(wire::READ_JOBS);
  const auto of_cell = handlers_.answer(request);
  ASSERT_TRUE(of_cell) << of_cell.error().message;
  ASSERT_EQ(of_cell->jobs().size(), 1u);
  const wire::Job& job = of_cell->jobs().front();
  EXPECT_EQ(job.number(), first->id);
  EXPECT_EQ(job.stage(), wire::JOB_FAILED);
  EXPECT_EQ(job.what(), "too \"few\" rows");
  EXPECT_EQ(job.batch_ids(), std::vector<std::string>{"lt-07"});
  EXPECT_GE(job.finished_unix_s(), job.started_unix_s());
  EXPECT_GE(job.started_unix_s(), job.created_unix_s());
  request.about().cell("");
  EXPECT_EQ(handlers_.answer(request)->jobs().size(), 1u);
  request.about().cell("cell-8");
  EXPECT_TRUE(handlers_.answer(request)->jobs().empty());
}

TEST_F(HandlersTest, TheAgeOfTheDataIsThatOfTheNewestMeasurement) {
  const std::int64_t now = unix_now_s();
  CompensatedModel::Parts parts = test::shifted_model(backend_.cell, 1e-4).parts();
  parts.provenance.trained_at = now - 100;
  const auto age = [&](std::optional<std::int64_t> measured_at) {
    parts.provenance.measured_at = measured_at;
    parts.provenance.batch_id += "+";
    const CompensatedModel model = CompensatedModel::make(parts).value();
    const int version = backend_.store->add_model("cell-7", model, 0, true, "").value();
    backend_.registry.publish(
        std::make_shared<const ServedModel>(ServedModel{"cell-7", version, model}));
    const wire::ModelInfo listed =
        handlers_.answer(read_request(wire::READ_MODELS))->models().back();
    const wire::ModelInfo served = handlers_.answer(predict_request())->model();
    EXPECT_EQ(listed.trained_at_unix_s(), now - 100);
    EXPECT_NEAR(listed.training_age_s(), 100, 5);
    EXPECT_EQ(served.measured_at_unix_s(), listed.measured_at_unix_s());
    EXPECT_EQ(listed.measured_at_unix_s(), measured_at.value_or(-1));
    EXPECT_EQ(std::isnan(served.data_age_s()), std::isnan(listed.data_age_s()));
    return listed.data_age_s();
  };
  EXPECT_NEAR(age(now - 5000), 5000, 5);
  EXPECT_TRUE(std::isnan(age(std::nullopt))) << "nobody recorded it";
}

TEST_F(HandlersTest, EveryAnswerOfAModelAndTheListSayWhatAUserOfItShouldKnow) {
  const CompensatedModel model = test::shifted_model(backend_.cell, 1e-4);
  for (const bool in_force : {false, true})
    ASSERT_TRUE(backend_.store->add_model("cell-7", model, 0, in_force, ""));
  backend_.registry.publish(std::make_shared<const ServedModel>(ServedModel{"cell-7", 2, model}));
  const auto codes = [](const wire::ModelInfo& told) {
    std::vector<std::string> all;
    for (const wire::Note& note : told.notes()) all.emplace_back(note.code().c_str());
    return all;
  };
  const std::vector<std::string> expected = {"robot_not_confirmed"};
  EXPECT_EQ(codes(handlers_.answer(predict_request())->model()), expected);
  EXPECT_EQ(codes(handlers_.answer(correct_request())->model()), expected);
  const auto listed = handlers_.answer(read_request(wire::READ_MODELS));
  ASSERT_EQ(listed->models().size(), 2u);
  EXPECT_TRUE(codes(listed->models().front()).empty()) << "it is not loaded to be listed";
  EXPECT_EQ(codes(listed->models().back()), expected);
  EXPECT_EQ(listed->models().back().notes().front().severity(), wire::NOTE_INFO);
  EXPECT_EQ(codes(listed->in_force()), expected);
}

TEST_F(HandlersTest, TheListTellsWhereTheMillimetresOfTheModelInForceComeFrom) {
  CompensatedModel::Parts parts = test::shifted_model(backend_.cell, 1e-4).parts();
  parts.budget.emplace();
  parts.budget->poses = 20;
  parts.budget->as_it_stands.error_rms = 1e-3;
  BudgetLine zero;
  zero.line = "zero:4";
  zero.kind = LineKind::kJointZero;
  zero.name = "the zero of joint 4";
  zero.alone_rms = 1e-3;
  parts.budget->as_it_stands.lines = {zero};
  const CompensatedModel model = CompensatedModel::make(std::move(parts)).value();
  for (const bool in_force : {false, true})
    ASSERT_TRUE(backend_.store->add_model("cell-7", model, 0, in_force, ""));
  backend_.registry.publish(std::make_shared<const ServedModel>(ServedModel{"cell-7", 2, model}));
  const auto listed = handlers_.answer(read_request(wire::READ_MODELS));
  ASSERT_EQ(listed->models().size(), 2u);
  EXPECT_TRUE(listed->models().front().budget().empty());
  const auto& told = listed->models().back().budget();
  ASSERT_EQ(told.size(), 2u);
  EXPECT_NE(std::string(told[1]).find("the zero of joint 4: 1.000 mm alone"), std::string::npos)
      << std::string(told[1]);
  EXPECT_TRUE(handlers_.answer(predict_request())->model().budget().empty())
      << "an answer of a pose is short";
}

TEST_F(HandlersTest, RepliesCarryTheIdOfTheirRequestAndTheServer) {
  test::Answered<wire::PredictError> calls(handlers_, "server-a");
  auto request = predict_request();
  request.header().contract_version(wire::CONTRACT_VERSION);
  request.header().request_id().sequence_number(77);
  request.header().request_id().writer_guid()[3] = 9;
  const auto reply = calls.reply_to(request);
  EXPECT_EQ(reply.header().result(), wire::RESULT_NOT_FOUND);
  EXPECT_EQ(reply.header().related_request_id().sequence_number(), 77);
  EXPECT_EQ(reply.header().related_request_id().writer_guid()[3], 9);
  EXPECT_EQ(reply.header().server().to_string(), "server-a");
}

TEST_F(HandlersTest, AnErrorArrivesAsASentenceAndAsData) {
  test::Answered<wire::PredictError> calls(handlers_, "server-a");
  backend_.serve(1);
  auto request = predict_request(2);
  request.poses()[1].joints_rad()[2] = 1.5;  // limit 70 deg
  request.header().trace_id("job-17");
  const auto reply = calls.reply_to(request);
  EXPECT_EQ(reply.header().result(), wire::RESULT_REFUSED);
  EXPECT_EQ(reply.header().trace_id().to_string(), "job-17");
  EXPECT_NE(reply.header().message().find("joint vector 2"), std::string::npos);
  ASSERT_EQ(reply.header().problems().size(), 1u);
  const wire::Problem& problem = reply.header().problems().front();
  EXPECT_EQ(problem.code(), wire::RESULT_REFUSED);
  EXPECT_EQ(problem.file(), "joint vector 2");
  EXPECT_EQ(problem.field(), "q3_deg");
  EXPECT_TRUE(problem.has_value() && problem.has_limit());
  EXPECT_NEAR(problem.value(), 85.9437, 1e-3);
  EXPECT_EQ(problem.limit(), 70);
}

TEST_F(HandlersTest, ARepeatedTrainingRequestIsCarriedOutOnce) {
  ASSERT_TRUE(handlers_.answer(submit_request("lt-07")));
  test::Answered<wire::Train> calls(handlers_, "server-a");
  wire::TrainRequest request;
  request.change().expected_version(-1);
  request.header().contract_version(wire::CONTRACT_VERSION);
  request.header().request_id().sequence_number(8);
  request.about().cell("cell-7");
  const auto first = calls.reply_to(request);
  const auto repeat = calls.reply_to(request);
  ASSERT_EQ(first.header().result(), wire::RESULT_OK) << first.header().message();
  EXPECT_EQ(repeat.job(), first.job());
  request.header().request_id().sequence_number(9);
  EXPECT_NE(calls.reply_to(request).job(), first.job());
}

constexpr wire::ContentId kThis{1, 4}, kThat{2, 4}, kThatElsewhere{2, 0};

/// Keeps what was answered.
class Kept final : public ReplySink {
 public:
  std::vector<wire::TrainReply> replies;
  void send(const ReplyAddress&, std::shared_ptr<void> reply, std::size_t) override {
    replies.push_back(*static_cast<wire::TrainReply*>(reply.get()));
  }
  void post(const ReplyAddress& to, std::shared_ptr<void> reply, std::size_t bytes) override {
    send(to, std::move(reply), bytes);
  }
};

TEST_F(HandlersTest, ARepeatIsNoConflictWhileSomethingElseUnderItsIdIsStillBeingRefused) {
  ASSERT_TRUE(handlers_.answer(submit_request("lt-07")));
  Kept kept;
  CallCounts counts;
  CallContext<wire::Train> context{"server-a", "replies", handlers_, kept, counts};
  const auto call_for = [&](const wire::ContentId& content) {
    auto request = std::make_unique<wire::Received<wire::TrainRequest>>();
    request->change().expected_version(-1);
    request->header().request_id().sequence_number(8);
    request->about().cell("cell-7");
    request->content = content;
    return std::make_unique<Call<wire::Train>>(context, std::move(request), ReplyAddress{}, "8",
                                               nullptr);
  };
  {
    const auto first = call_for(kThis);
    first->compute(0, first->begin());
    first->finish();
  }
  const auto other = call_for(kThat);
  EXPECT_EQ(other->begin(), 0u) << "refused, and not answered yet";
  EXPECT_TRUE(call_for(kThis)->is_answered_for_its_id());
  EXPECT_TRUE(call_for({3, 4})->is_answered_for_its_id());
  other->finish();
  ASSERT_EQ(kept.replies.size(), 4u);
  EXPECT_EQ(kept.replies[0].header().result(), wire::RESULT_OK)
      << kept.replies[0].header().message();
  EXPECT_EQ(kept.replies[1].header().result(), wire::RESULT_OK) << "the repeat of the first";
  EXPECT_EQ(kept.replies[1].job(), kept.replies[0].job());
  for (std::size_t i = 2; i < kept.replies.size(); ++i)
    EXPECT_EQ(kept.replies[i].header().result(), wire::RESULT_CONFLICT) << i;
  EXPECT_EQ(counts.refused, kept.replies.size() - 2);
}

TEST(UnderWay, ARepeatIsNotCarriedOutBesideTheFirstAndHasItsAnswerAfterIt) {
  UnderWay under_way;
  {
    UnderWay::Piece first(under_way, "a", kThis), other(under_way, "b", kThis);
    EXPECT_TRUE(first.is_first());
    EXPECT_TRUE(other.is_first());
    for (int i = 0; i < 2; ++i) EXPECT_FALSE(UnderWay::Piece(under_way, "a", kThis).is_first());
    EXPECT_TRUE(first.has_repeat());
    EXPECT_TRUE(first.has_repeat());
    EXPECT_FALSE(other.has_repeat());
    EXPECT_FALSE(first.has_repeat());
    EXPECT_TRUE(UnderWay::Piece(under_way, "a", kThis).is_first())
        << "it is answered: another one begins anew";
  }
  EXPECT_TRUE(UnderWay::Piece(under_way, "b", kThis).is_first());
}

TEST(UnderWay, SomethingElseUnderTheSameIdIsNoRepeat) {
  UnderWay under_way;
  UnderWay::Piece first(under_way, "a", kThis);
  {
    const UnderWay::Piece that(under_way, "a", kThat);
    EXPECT_TRUE(that.is_other());
    EXPECT_FALSE(that.is_first());
    EXPECT_FALSE(UnderWay::Piece(under_way, "a", kThatElsewhere).is_other())
        << "headers of other lengths";
  }
  EXPECT_TRUE(first.has_repeat());
  EXPECT_FALSE(first.has_repeat()) << "only the repeat has the answer of the first";
}

TEST(ReplyMemory, ForgetsTheOldest) {
  ReplyMemory<int> memory(2);
  memory.remember("a", kThis, 1);
  memory.remember("b", kThis, 2);
  memory.remember("c", kThis, 3);
  EXPECT_FALSE(memory.find("a"));
  EXPECT_EQ(memory.find("b").value().reply, 2);
  EXPECT_EQ(memory.find("c").value().reply, 3);
}

TEST(Codec, PrismaticJointsTravelInMillimetres) {
  Joint rail;
  rail.type = JointType::kPrismatic;
  const Chain chain = Chain::make("rail and hinge", {rail, Joint{}}).value();
  JointVector q(2);
  q << 1.5, 0.25;
  Correction correction;
  correction.q = q;
  const exchange::Rails rails = exchange::rails_of(chain);
  const wire::Joints joints = wire::to_wire(exchanged(correction, rails), rails).joints_rad();
  EXPECT_EQ(joints[0], 1500);
  EXPECT_TRUE(from_wire(joints, chain, "here")->isApprox(q));
}

TEST(Codec, PosesComeBack) {
  const Pose X = pose_zyx({0.1, -0.2, 1.3}, 0.4, -0.5, 0.6);
  const auto back = from_wire(wire::to_wire(exchange::from_si(X)), "here");
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_TRUE(back->isApprox(X, 1e-12));
}

TEST(Codec, ACorrectionComesBackFromTheWireToTheLastBit) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> angle(-kPi, kPi);
  for (int i = 0; i < 1000; ++i) {
    Correction correction;
    correction.status = CorrectionStatus::kOutOfDomain;
    correction.q = JointVector::NullaryExpr(6, [&] { return angle(random); });
    correction.turn_before = 1e-3 * angle(random);
    const exchange::CorrectedTarget told = exchanged(correction, {});
    const exchange::CorrectedTarget back = wire::from_wire(wire::to_wire(told, {}), {});
    EXPECT_EQ(back.status, "out_of_domain");
    EXPECT_EQ(back.joints_deg, told.joints_deg);
    EXPECT_EQ(back.turn_before_deg, told.turn_before_deg);
  }
}

TEST(Codec, EveryStatusHasItsWord) {
  for (const CorrectionStatus status :
       {CorrectionStatus::kOk, CorrectionStatus::kOutOfDomain, CorrectionStatus::kJointLimit,
        CorrectionStatus::kUnreachable, CorrectionStatus::kSingular,
        CorrectionStatus::kNotConverged, CorrectionStatus::kRefused}) {
    Correction correction;
    correction.status = status;
    const wire::TargetStatus on_wire = wire::to_wire(exchanged(correction, {}), {}).status();
    EXPECT_EQ(wire::word_of(on_wire), to_string(status));
    EXPECT_EQ(static_cast<int>(on_wire), static_cast<int>(status));
  }
}

}  // namespace
}  // namespace trammel
