#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "idl/exchange/wire_values.h"
#include "server/compensate/exchanged.h"
#include "server/dds/codec.h"
#include "server/dds/handlers.h"
#include "server/measurement/pose_check.h"

namespace trammel {
namespace {

constexpr std::size_t kPosesTold = 20;  // poses of a request that are kept as recent ones

/// The pose in the form of a question to the model; refuses joints that the cell's arm cannot have.
Result<PoseContext> context_of(const wire::CommandedJoints& wanted, const Subject& subject,
                               const std::string& where) {
  const Cell& cell = subject.served->model.cell();
  auto q = TRY(from_wire(wanted.joints_rad(), cell.robot, where));
  PoseContext pose;
  pose.q = std::move(q);
  pose.tool = subject.tool;
  pose.payload = subject.payload;
  pose.served = true;
  TRY(read_approach(wanted.approach(), cell.robot, where, pose));
  if (const Status possible = check_pose(pose, cell); !possible)
    return Failure(possible.error()).in(where);
  return pose;
}

/// Its poses are checked, its model is taken.
class PortionedPredictions final : public PortionedAnswer<wire::PredictErrorReply> {
 public:
  PortionedPredictions(Subject subject, std::vector<PoseContext> poses, WorkCounts& work)
      : subject_(std::move(subject)), poses_(std::move(poses)), work_(work) {
    reply_.model(trammel::to_wire(*subject_.served, subject_.in_force, unix_now_s()));
    reply_.predictions().resize(poses_.size());
  }
  std::size_t items() const override { return poses_.size(); }
  void compute(std::size_t first, std::size_t count) override {
    const CompensatedModel& model = subject_.served->model;
    WorkFigures work;
    for (std::size_t i = first; i < first + count; ++i) {
      const ErrorPrediction prediction = model.predict_all({poses_[i]}).front();
      reply_.predictions()[i] = wire::to_wire(exchanged(prediction));
      work.answered(prediction.in_domain, prediction.true_stddev_B.norm() / std::sqrt(3.0));
    }
    work_.add(subject_.served->cell, work);
  }
  wire::PredictErrorReply take() override { return std::move(reply_); }

 private:
  const Subject subject_;
  const std::vector<PoseContext> poses_;
  WorkCounts& work_;
  wire::PredictErrorReply reply_;
};

}  // namespace

Result<Handlers::Predictions> Handlers::begin(const wire::PredictErrorRequest& request) {
  auto subject = TRY(subjects_.find(request.about()));
  std::vector<PoseContext> poses;
  poses.reserve(request.poses().size());
  for (std::size_t i = 0; i < request.poses().size(); ++i) {
    auto pose = TRY(context_of(request.poses()[i], subject, fmt::format("joint vector {}", i + 1)));
    poses.push_back(std::move(pose));
  }
  // The last poses represent all.
  const std::size_t told = std::min<std::size_t>(poses.size(), kPosesTold);
  for (std::size_t i = poses.size() - told; i < poses.size(); ++i)
    trainer_.recent_poses().add(request.about().cell(), poses[i]);
  return std::make_unique<PortionedPredictions>(std::move(subject), std::move(poses), work_);
}

Result<wire::PredictErrorReply> Handlers::answer(const wire::PredictErrorRequest& request) {
  return computed(begin(request));
}

bool happens_once(const wire::PredictErrorRequest&) { return false; }

}  // namespace trammel
