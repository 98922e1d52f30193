#pragma once

#include <Eigen/Core>
#include <cstddef>

/// Every number that decides what a diagnosis finds, names and doubts: one name, one value, one
/// place. Evidence and scores are in nat: 2.3 nat are odds of 10 to 1. A strength is a squared size
/// in standard deviations of the noise; half of it is the evidence that it brings at most. What
/// only steers a computation stands beside that computation.
namespace trammel::cause_search::thresholds {

// Finding: what passes.

/// Share of batches with nothing to find in which the best of all candidates passes the line of one
/// scan. A diagnosis scans at least twice; all of it stays below 1 false alarm in 100 batches.
inline constexpr double kFalseAlarms = 0.003;
/// Times the line: a score between these two is so near that the line is computed anew for the
/// present background. No background has moved it further.
inline constexpr double kNearLine[] = {0.6, 1.6};
/// Times the line: a cause above it needs no folds. A fold has seven eighths of the poses, and so
/// of the score; it still sees five times the line.
inline constexpr double kBeyondFolds = 6;
/// Share of the best score that a cause needs to take part in the folds. A fold has seven eighths
/// of the poses. With so many, a cause that has a third of the best score on all poses does not
/// become the best.
inline constexpr double kFoldContender = 0.3;
/// Nat by which an anonymous function must beat the best named cause: odds of 7 to 1.
inline constexpr double kUnnamedMargin = 2;
/// Nat by which something slow must beat a step or a drift to be taken in its place: odds of 150
/// to 1. Steps are what happens to robots, and what is slow has more courses than anybody lists.
inline constexpr double kSlowInstead = 5;
/// A step is beyond doubt if it beats everything slow by this share of its strength (nat), less
/// kStepChance. If there is a step, every smooth course leaves more than this share of it
/// unexplained. If there is something slow, the step loses.
inline constexpr double kStepShare = 0.04;
/// Nat that chance takes off: a step of strength 75 or less need not win, but must not lose.
inline constexpr double kStepChance = 3;
/// Share of the squares of poses held out that a cause must take away: one per cent of their rms. A
/// name that gains less is none, however sure it is.
inline constexpr double kLeastGain = 0.02;
/// Standard deviations by which that gain must be beyond chance: 95 %, one side.
inline constexpr double kGainBeyondChance = 1.645;
/// The number of named causes that together may beat one anonymous function.
inline constexpr int kNamedPath = 3;
/// Nat by which a cause that begins at a pose must beat the same cause from the first pose on, and
/// a map of a joint an eccentric encoder: what choosing one of 150 poses is worth (log 150).
inline constexpr double kSimplerMargin = 5;
/// Cycles a joint turn: orders that are nearer are one. A full turn of the joint just tells a whole
/// cycle apart.
inline constexpr double kSameOrder = 0.5;
/// Share of the poses that may be out, in a diagnosis and in triage. With more of them it is not
/// single poses that are wrong.
inline constexpr double kMostOutliers = 0.1;
/// Another pose is out as well if its evidence is at least this share of that of the pose that is
/// farthest out. A single bad pose draws the others out by far less: by the square of its share in
/// the fit.
inline constexpr double kOutAsWell = 0.25;
/// rad: a joint that moves less shows no function of its angle. Two degrees.
inline constexpr double kSmallestSpan = 0.035;
/// K between the coldest and the warmest pose: less is one temperature, and nothing grows.
inline constexpr double kSameTemperature = 0.5;

/// Times the squares of poses held out that an anonymous function leaves: a cause of the whole arm
/// that leaves no more takes its place, and another one that leaves no more than the best of them
/// is its rival.
inline constexpr double kAsGoodHeldOut = 1.05;
/// Times the stated noise that is left where nothing was found at all, beyond which each cause is
/// tried not to first order; and the share of the squares of poses held out that it may leave to be
/// named.
inline constexpr double kLeavesMuch = 3;
inline constexpr double kMuchBetterHeldOut = 0.5;

// Naming: which other causes explain a finding as well.

/// Canonical correlation above which two causes do the same to the poses.
inline constexpr double kSameEffect = 0.95;
/// Share of an effect's strength that another cause explains at least if it has the same effect.
inline constexpr double kSameShare = kSameEffect * kSameEffect;
/// The share of a cause that explains all of it: however strong the effect is, the two cannot be
/// told apart.
inline constexpr double kWholeShare = 0.995;
/// The share of a cause that is related, and may be there instead. A correlation of 0.63.
inline constexpr double kRelatedShare = 0.4;
/// A cause that wins a repetition, and explains less than this share of the effect, has won by
/// another effect, by chance. A correlation of 0.32.
inline constexpr double kCoincidenceShare = 0.1;
/// Share of simulated repetitions that must give a name for it to be sure.
inline constexpr double kSureFrequency = 0.9;
/// Share of them that another cause must win to be a rival: three of a hundred, for one is chance.
inline constexpr double kRivalFrequency = 0.03;
/// Share of the best score that a cause needs to be among those that repetitions choose from.
/// Others won none.
inline constexpr double kNamingContender = 0.15;
/// Nat by which these data favour a cause when they have decided for it: odds of 4.5 to 1. At 3 nat
/// 87 % of the effects of strength 60 were named, at 1.5 nat 92 %, and 6 of 1510 names were wrong.
inline constexpr double kDecided = 1.5;
/// kDecided where less than kSureFrequency of the repetitions give the name: odds of 12 to 1.
inline constexpr double kDecidedUnsure = 2.5;
/// Strength by which a cause of the same effect may explain less and is as good: 3 nat of
/// likelihood.
inline constexpr double kAsGoodStrength = 6;
/// Nat of score by which a cause of the same effect must lose to be out however well it fits:
/// nearly the same effect from so many more numbers is no accident.
inline constexpr double kMoreNumbers = 8;
/// Share of an effect's strength by which real causes differ from their models.
inline constexpr double kShapeError = 0.02;
/// Share of the poses: a step that begins before it stands for something that always acted.
inline constexpr double kAtOnce = 0.05;
/// rad that no joint exceeds from pose to pose along a path that was measured in motion.
inline constexpr double kPathStep = 0.2;

// Doubting: what makes a finding unsure once everything was found.

/// Nat by which a size that changes with time or temperature must beat one that stays: odds of 3000
/// to 1.
inline constexpr double kChangesSize = 8;
/// Numbers of a cause of one joint above which it fits a part of many other causes.
inline constexpr int kManyNumbers = 12;
/// Times what is unexplained (rms): a pose that is out by less may be where that is largest.
inline constexpr double kFarOut = 10;
/// Share of the range of all other poses by which a pose must lie beyond them to stand at the edge:
/// in the angle of a gear, in the torque on it, or in its reach.
inline constexpr double kBeyondOthers = 0.05;
/// Share of the size of what is unknown: an effect that is smaller may be part of it.
inline constexpr double kDwarfed = 0.25;
/// Nat that the other numbers of its source must explain for a cause to be named as a whole instead
/// of by one number. Below it 14 of the intervals of single numbers were wrong.
inline constexpr double kOthersSpeak = 5;
/// Orders of one joint's gear that are believed beside each other. More are an error that has no
/// single order.
inline constexpr std::ptrdiff_t kMostOrders = 2;
/// Times its prior beyond which an off-centre encoder (1 mrad) is larger than robots have it.
inline constexpr double kUnlikelyEccentricity = 2;
/// Times its prior (100 mm) beyond which the centre of gravity of a payload is unlikely.
inline constexpr double kUnlikelyPayload = 5;
/// Standard deviations below zero at which the play of a joint has the wrong sign: 95 %, one side.
inline constexpr double kWrongSign = 1.645;
/// kWrongSign for the play at one pose, of which there are many: 98 %, one side.
inline constexpr double kWrongSignOfPose = 2;
/// Share of the poses that may have play of the wrong sign. A quarter is more than the side of a
/// pose is mistaken.
inline constexpr double kPosesOfWrongSign = 0.25;
/// Poses held out that say whether a model is worse: fewer are outvoted by one of them.
inline constexpr std::size_t kFewestHeldOut = 7;
/// Chance that any of the held-out poses that fit is called one that fits neither model.
inline constexpr double kMisjudgedHeldOut = 0.01;

/// m that parts move at most when they warm up, and rad that a joint's zero does: larger is
/// something loose.
inline constexpr double kWarmthMoves = 5e-4;
inline constexpr double kWarmthTurns = 1e-3;

// Rows that say what was done wrong with them.

/// Standard deviations of an axis within which a pose that fits nothing fits as another tool,
/// payload or row: of three axes chance leaves more in 1 of 30 000 poses.
inline constexpr double kFitsOtherwise = 5;
/// Share of its distance as it stands to which that must come down.
inline constexpr double kFitsBetter = 0.3;
/// Standard deviations that play must make at a pose for the pose to show which side it came from.
inline constexpr double kShowsItsSide = 4;
/// Nat by which the other side must be the likelier: odds of 160 000 to 1, for there are many
/// poses.
inline constexpr double kSureOfSide = 12;

// The rest of the residual, against what is stated for one measurement.

/// Times the stated standard deviation up to which poses measured repeatedly say how noisy the
/// measurement is. Where they scatter by more, something moved between them.
inline constexpr double kRepeatsVouch = 3;
/// Standard uncertainty of the stated standard deviation, as a share of it.
inline constexpr double kSigmaKnownTo = 0.1;
/// Standard uncertainties, of sigma and of chance together, beyond which what is left is not the
/// measurement; of chance alone, beyond which it is worth a note.
inline constexpr double kNoiseDeviations = 2;
/// Times the stated standard deviation, beyond which nobody calls it noise: exp(2 * 0.104), of 200
/// poses.
inline constexpr double kMoreThanNoise = 1.23;

/// Holm-corrected chance below which what is left changes with a joint, the torque or the time,
/// though no function was found that says how.
inline constexpr double kChangesWith = 1e-3;

// Causes that these poses could not have shown, and causes that they cannot tell apart.

/// Standard deviations by which an effect must exceed the line to pass it in nine of ten batches.
inline constexpr double kPower = 1.2816;
/// Share of an effect's length that the model's own parameters leave over: with less there is
/// nothing to go by.
inline constexpr double kAbsorbed = 0.05;
/// Strength that must lie between a cause and its closest imitator for one to be told from the
/// other: 10 nat.
inline constexpr double kToldApart = 20;
/// Cosine between an effect and one parameter, above which it is said to be that parameter.
inline constexpr double kLikeOneParameter = 0.9;
/// Share of the present uncertainty that next poses may leave. What they do not lower by a tenth is
/// not worth measuring.
inline constexpr double kWorthMeasuring = 0.9;

}  // namespace trammel::cause_search::thresholds
