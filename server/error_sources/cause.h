#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/result.h"

/// What a physical cause of error is, apart from what it does to the arm: everything that calibration, diagnosis,
/// planning, training and the pages want to know of it. The record stands beside the physics, in the cause's own file.
namespace trammel {

class ErrorSource;
struct Cell;

/// What must have been recorded with each pose for a cause to show.
struct ContextNeeds {
  bool time = false;
  bool temperature = false;
  bool direction = false;  ///< of the source's joint, from both sides
  bool velocity = false;
  bool payload = false;  ///< something must hang on the flange
};

/// `gear_transmission:3@48.5+97`: a cause, the joint it concerns, and what else says which one is meant.
struct SourceSpec {
  std::string text;        ///< as spelled
  std::string name;        ///< the cause, or its form
  int joint = -1;          ///< 0-based; -1 where none is named
  std::vector<double> at;  ///< after the @: orders, or the pose (1-based row of the batch) at which it begins
};
using SourceMaker = Result<std::shared_ptr<const ErrorSource>> (*)(const SourceSpec& spec, const Cell& cell);

/// What a record is made of.
namespace causes {

/// Whose cause it is.
enum class Scope {
  kArm,      ///< of the whole arm
  kJoint,    ///< of one joint, or of the link that follows it: its spelling ends in `:joint`
  kCell,     ///< of what the cell file says besides: where the robot stands and what it carries
  kPose,     ///< of single poses
  kSession,  ///< of measuring: where the instrument stands, and its clock
};

/// How long it goes on.
enum class Lasting {
  kAlways,        ///< belongs into the cell file
  kFromAPose,     ///< begins at a pose of a batch: its spelling ends in `@row`
  kOfTheSession,  ///< of one batch, and all of it
};

/// Which part of the nominal cell its parameters correct.
enum class Part { kNone, kBase, kLinks, kTool, kPayload };

/// How diagnosis looks for it.
enum class SearchFamily {
  kNone,      ///< not at all
  kColumns,   ///< its parameters, all at once
  kPlay,      ///< the same, with a sign that it cannot have
  kStep,      ///< its parameters from a pose on, at every pose
  kZeroStep,  ///< the same of a joint's own zero
  kOrder,     ///< a sine and a cosine of a joint's angle, at every order
  kMap,       ///< any periodic function of a joint's angle
  kPose,      ///< every pose by itself
};

/// Whether single numbers of a cause may be lacking, the others being right.
enum class Numbers {
  kTogether,   ///< they stand and fall together
  kSingly,     ///< one by one; whichever it is, it is this cause
  kApart,      ///< one by one, and two of them are two causes
  kOneAJoint,  ///< the same, and each is a joint's
};

/// What people are told of its parameters before the parameters themselves.
enum class Summary { kNone, kOrderAndAmplitude, kAmplitude, kPeakToPeak };

/// How another cause is like this one.
enum class Likeness {
  kFromTheFirstPose,  ///< it is what this one would be if it had begun before the first pose
  kSpecialCase,       ///< this one describes it as well, more generally
  kSimplerCase,       ///< the same; and it is preferred where it explains nearly as much
  kDoubtfulCase,      ///< the same; but where neither is clearly better neither is sure
  kWhereConstant,     ///< it takes this one over where what this one depends on never changes
  kImitator,          ///< another thing altogether, that looks like this one at some poses
};
struct Rival {
  std::string_view cause;
  Likeness likeness = Likeness::kImitator;
  std::string_view parameter =
      {};               ///< the one of its numbers that is meant, `{}` for the joint; empty: the whole cause
  double surprise = 0;  ///< nat: how much less this cause is to be expected while the model has no source of that one
};

/// What tells a cause from whatever looks like it. Of two causes the remedy with the lower rank speaks.
struct Remedy {
  int rank = 0;
  std::string_view text;
};
/// Remedies that several causes share.
namespace remedies {
inline constexpr Remedy kBothSides{10, "approaching every pose from both sides (--bidirectional)"};
inline constexpr Remedy kOtherLoad{20, "a second known payload, or a run without any"};
inline constexpr Remedy kOtherTemperature{30, "a second temperature, recorded with every pose"};
inline constexpr Remedy kReflectors{40, "reference reflectors, and the time of every pose"};
inline constexpr Remedy kOtherSpeed{50, "other speeds, and the time of every pose"};
inline constexpr Remedy kOtherTool{60, "a second tool"};
inline constexpr Remedy kFixedBase{70, "reference reflectors that fix where the base stands"};
inline constexpr Remedy kWiderRange{80, "a wider range of joints, or another tool"};
}  // namespace remedies

/// A number that is reported of a cause, in the order of reporting.
struct Figure {
  std::string_view name;  ///< how its name begins
  std::string_view unit;  ///< as people read it; may be empty
  std::string_view meaning;
};

/// What a new batch shows when a step happened before its first pose.
struct WholeBatch {
  std::string_view sentence;  ///< for people; `{}` for the joint
  bool harmful = false;       ///< a model must not learn from it: what it would learn is of something else
};

/// A size of effect that people are shown as an example.
struct Example {
  int rank = 0;    ///< the lower, the sooner
  int joint = -1;  ///< 0-based; -1: any
};

/// When it acts on the arm: in the order given here, then by `turn`, then in the order of registration.
enum class ActsOn { kNothing, kBase, kLinks, kTool, kJoints, kLoad, kLoadedArm };
struct Acting {
  ActsOn on = ActsOn::kNothing;
  int turn = 0;
};

/// A way of computing a cause. Most have one, of the cause's own spelling.
struct Form {
  std::string_view spelling;
  SourceMaker make;
};

}  // namespace causes

struct CauseRecord {
  std::string_view spelling;    ///< in files and programs: `gear_transmission`
  std::string_view plain_name;  ///< for people: `gear ripple`
  std::string_view
      plain_name_of_joint;  ///< the same of one joint: `gear ripple in joint {}`; empty where it is of none
  causes::Scope scope;
  causes::Lasting lasting;
  ContextNeeds needs;
  causes::SearchFamily search;
  causes::Acting acts;
  std::vector<causes::Form> forms;  ///< the usual one first; none: no error source describes it
  std::vector<causes::Rival> rivals;
  causes::Remedy told_apart_by;
  std::string_view shown_by;            ///< what a batch that cannot show it would need
  std::string_view action;              ///< for the shop floor
  std::vector<causes::Figure> figures;  ///< of its findings: those of the summary, then its parameters

  // What only some causes have.
  causes::Part part = causes::Part::kNone;
  causes::Numbers numbers = causes::Numbers::kTogether;
  causes::Summary summary = causes::Summary::kNone;
  bool takes_numbers = false;        ///< its spelling may end in `@number+number`
  bool of_turning_joint = false;     ///< of revolute joints only
  bool gives_way = false;            ///< bends under a load: a payload shows through it
  bool goes_with_time = false;       ///< looks like whatever else goes on with time
  std::optional<double> order = {};  ///< cycles a joint turn, where it always has the same
  std::optional<causes::WholeBatch> whole_batch = {};
  std::optional<causes::Example> example = {};
  /// Whether the forms differ in a cell; else the usual one is the only one.
  bool (*forms_differ)(const Cell& cell) = nullptr;
};

/// What a step would be if it had begun before the first pose; null for what does not begin at a pose.
[[nodiscard]] const causes::Rival* whole_of(const CauseRecord& record);

/// The parameter that a rival of a cause of `joint` (0-based) means: `q3`.
[[nodiscard]] std::string parameter_of(const causes::Rival& rival, int joint);

/// `gear ripple in joint 3`, or `gear ripple` without a joint (0-based; -1).
[[nodiscard]] std::string plain_name(const CauseRecord& record, int joint = -1);

}  // namespace trammel
