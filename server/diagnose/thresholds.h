#pragma once

#include <Eigen/Core>
#include <cstddef>

/// All numbers that decide what a diagnosis finds, names and doubts: one name, one value, one
/// place. Evidence and scores are in nat: 2.3 nat are odds of 10 to 1. A strength is a squared size
/// in standard deviations of the noise; half of it is the most evidence that it can bring. Numbers
/// that only steer a computation stay beside that computation.
namespace trammel::cause_search::thresholds {

// Finding: the conditions for passing.

/// Among batches without any cause to find, the share in which the best of all candidates passes
/// the limit of one scan. A diagnosis scans at least twice; in total it stays below 1 false alarm
/// in 100 batches.
inline constexpr double kFalseAlarms = 0.003;
/// Times the limit of one scan. A score between these two factors is so near the limit that the
/// limit is computed anew for the present background. No background has moved the limit further.
inline constexpr double kNearLine[] = {0.6, 1.6};
/// Times the line: a cause above it needs no folds. A fold has seven eighths of the poses, and so
/// of the score; that is still five times the line.
inline constexpr double kBeyondFolds = 6;
/// Share of the best score that a cause needs to take part in the folds. A fold has seven eighths
/// of the poses. With so many, a cause that has a third of the best score on all poses does not
/// become the best.
inline constexpr double kFoldContender = 0.3;
/// Nat by which an anonymous function must beat the best named cause: odds of 7 to 1.
inline constexpr double kUnnamedMargin = 2;
/// Nat by which a slow effect must beat a step or a drift to replace it: odds of 150 to 1. Robots
/// do take steps, and slow effects have more courses than any list.
inline constexpr double kSlowInstead = 5;
/// A step is beyond doubt if it beats every slow course by this share of its strength (nat), less
/// kStepChance. If the cause is a step, every smooth course leaves more than this share of it
/// unexplained. If the cause is slow, the step loses.
inline constexpr double kStepShare = 0.04;
/// Nat allowed for chance: a step of strength 75 or less need not win, but must not lose.
inline constexpr double kStepChance = 3;
/// Share of the squares of held-out poses that a cause must remove: one per cent of their rms. A
/// cause that gains less is not named, however certain it is.
inline constexpr double kLeastGain = 0.02;
/// Standard deviations by which that gain must exceed chance: 95 %, one side.
inline constexpr double kGainBeyondChance = 1.645;
/// The number of named causes that together may beat one anonymous function.
inline constexpr int kNamedPath = 3;
/// Nat by which a cause that begins at a pose must beat the same cause from the first pose on, and
/// a joint map an eccentric encoder. It is the price of choosing one of 150 poses (log 150).
inline constexpr double kSimplerMargin = 5;
/// Cycles a joint turn: orders that are nearer are one. A full turn of the joint just tells a whole
/// cycle apart.
inline constexpr double kSameOrder = 0.5;
/// Share of the poses that may be outliers, in a diagnosis and in triage. With more of them the
/// fault is not in single poses.
inline constexpr double kMostOutliers = 0.1;
/// Another pose is an outlier as well if its evidence is at least this share of that of the
/// farthest one. A single bad pose drags others out by far less: by the square of its share in the
/// fit.
inline constexpr double kOutAsWell = 0.25;
/// rad: a joint that moves less shows no function of its angle. Two degrees.
inline constexpr double kSmallestSpan = 0.035;
/// K between the coldest and the warmest pose: less is one temperature, and nothing grows.
inline constexpr double kSameTemperature = 0.5;

/// Times the squares of held-out poses left by an anonymous function. A cause of the whole arm that
/// leaves no more replaces the function. Another cause that leaves at most this multiple of the
/// best is its rival.
inline constexpr double kAsGoodHeldOut = 1.05;
/// Times the stated noise. If no cause was found and the residual exceeds this, each cause is tried
/// exactly, not to first order. The second number is the share of the squares of held-out poses
/// that a cause may leave to be named.
inline constexpr double kLeavesMuch = 3;
inline constexpr double kMuchBetterHeldOut = 0.5;

// Naming: which other causes explain a finding as well.

/// Canonical correlation above which two causes do the same to the poses.
inline constexpr double kSameEffect = 0.95;
/// Smallest share of an effect's strength that another cause explains if it has the same effect.
inline constexpr double kSameShare = kSameEffect * kSameEffect;
/// The share of an effect that counts as all of it: however strong the effect is, the two causes
/// cannot be distinguished.
inline constexpr double kWholeShare = 0.995;
/// A cause that explains this share of another cause is related, and may be present instead of it.
/// The share is a correlation of 0.63.
inline constexpr double kRelatedShare = 0.4;
/// A cause that wins a repetition, and explains less than this share of the effect, has won by
/// another effect, by chance. A correlation of 0.32.
inline constexpr double kCoincidenceShare = 0.1;
/// Share of simulated repetitions that must give a name for the name to be certain.
inline constexpr double kSureFrequency = 0.9;
/// Share of the repetitions that another cause must win to be a rival: three of a hundred, since
/// one is chance.
inline constexpr double kRivalFrequency = 0.03;
/// Share of the best score that a cause needs to be a candidate in the repetitions. Weaker ones
/// never won.
inline constexpr double kNamingContender = 0.15;
/// Nat by which the data must favour a cause to decide for it: odds of 4.5 to 1. At 3 nat 87 % of
/// the effects of strength 60 were named, at 1.5 nat 92 %, and 6 of 1510 names were wrong.
inline constexpr double kDecided = 1.5;
/// Replaces kDecided if less than kSureFrequency of the repetitions give the name: odds of 12 to 1.
inline constexpr double kDecidedUnsure = 2.5;
/// A cause with the same effect counts as equally good if its strength is less by at most this: 3
/// nat of likelihood.
inline constexpr double kAsGoodStrength = 6;
/// Nat of score by which a cause with the same effect must lose to be excluded however well it
/// fits: nearly the same effect from so many more numbers is not an accident.
inline constexpr double kMoreNumbers = 8;
/// Relative difference between real causes and their models, as a share of the effect's strength.
inline constexpr double kShapeError = 0.02;
/// Share of the poses: a step that begins earlier means an effect that always acted.
inline constexpr double kAtOnce = 0.05;
/// rad: the largest motion of a joint from pose to pose along a path measured in motion.
inline constexpr double kPathStep = 0.2;

// Doubting: the reasons that make a finding uncertain when everything was found.

/// Nat by which a size that changes with time or temperature must beat a constant one: odds of 3000
/// to 1.
inline constexpr double kChangesSize = 8;
/// A cause of one joint with more numbers than this fits parts of many other causes.
inline constexpr int kManyNumbers = 12;
/// Times the unexplained residual (rms): a pose that is out by less may be where that residual is
/// largest.
inline constexpr double kFarOut = 10;
/// Share of the range of all other poses by which a pose must lie beyond them to be at the edge: in
/// the angle of a gear, in the torque on it, or in its reach.
inline constexpr double kBeyondOthers = 0.05;
/// Share of the size of the unknown effect: a smaller effect may be part of it.
inline constexpr double kDwarfed = 0.25;
/// A cause is named as a whole if the other numbers of its source explain this many nat. Otherwise
/// a single number is named. With a lower value 14 of the intervals of single numbers were wrong.
inline constexpr double kOthersSpeak = 5;
/// Credible orders of one joint's gear beside each other. More of them mean an error without a
/// single order.
inline constexpr std::ptrdiff_t kMostOrders = 2;
/// Times its prior beyond which an off-centre encoder (1 mrad) is larger than robots have it.
inline constexpr double kUnlikelyEccentricity = 2;
/// Times its prior (100 mm) beyond which the centre of gravity of a payload is unlikely.
inline constexpr double kUnlikelyPayload = 5;
/// Standard deviations below zero beyond which the play of a joint has the wrong sign: 95 %, one
/// side.
inline constexpr double kWrongSign = 1.645;
/// kWrongSign for the play at one of many poses: 98 %, one side.
inline constexpr double kWrongSignOfPose = 2;
/// Share of the poses that may have play of the wrong sign. A quarter is more than the side of a
/// pose is mistaken.
inline constexpr double kPosesOfWrongSign = 0.25;
/// Held-out poses needed to judge whether a model is worse: among fewer, a single bad one decides.
inline constexpr std::size_t kFewestHeldOut = 7;
/// Chance that some held-out pose that fits is wrongly reported as fitting neither model.
inline constexpr double kMisjudgedHeldOut = 0.01;

/// The largest motion of parts that warm up, m, and of a joint's zero, rad: a larger one means a
/// loose part.
inline constexpr double kWarmthMoves = 5e-4;
inline constexpr double kWarmthTurns = 1e-3;

// Rows that show their own mistakes.

/// Standard deviations of an axis within which an outlier fits as another tool, payload or row. By
/// chance one of three axes exceeds this in 1 of 30 000 poses.
inline constexpr double kFitsOtherwise = 5;
/// Share of its original distance that a corrected row may keep.
inline constexpr double kFitsBetter = 0.3;
/// Standard deviations that play must make at a pose for the pose to show which side it came from.
inline constexpr double kShowsItsSide = 4;
/// Nat by which the other side must be the likelier: odds of 160 000 to 1, for there are many
/// poses.
inline constexpr double kSureOfSide = 12;

// The residual against the stated noise of one measurement.

/// Times the stated standard deviation: up to here the scatter of repeated poses measures the noise
/// of the measurement. If they scatter by more, something moved between them.
inline constexpr double kRepeatsVouch = 3;
/// Relative standard uncertainty of the stated standard deviation.
inline constexpr double kSigmaKnownTo = 0.1;
/// Standard uncertainties beyond which the residual is not measurement noise. The first limit
/// counts those of sigma and of chance together; the second counts those of chance alone and leads
/// to a note.
inline constexpr double kNoiseDeviations = 2;
/// Times the stated standard deviation, beyond which nobody calls it noise: exp(2 * 0.104), of 200
/// poses.
inline constexpr double kMoreThanNoise = 1.23;

/// Holm-corrected chance below which the residual depends on a joint, the torque or the time,
/// although no function was found for it.
inline constexpr double kChangesWith = 1e-3;

// Causes that these poses could not have shown, and causes that they cannot distinguish.

/// Standard deviations by which an effect must exceed the line so that it passes in nine of ten
/// batches.
inline constexpr double kPower = 1.2816;
/// Share of an effect's length that the model's own parameters must leave unexplained. A smaller
/// rest shows nothing.
inline constexpr double kAbsorbed = 0.05;
/// Strength that must lie between a cause and its closest imitator to distinguish them: 10 nat.
inline constexpr double kToldApart = 20;
/// Cosine between an effect and one parameter. Above it the report calls the effect that parameter.
inline constexpr double kLikeOneParameter = 0.9;
/// Share of the present uncertainty that the next poses may leave. If they lower it by less than a
/// tenth, they are not worth measuring.
inline constexpr double kWorthMeasuring = 0.9;

}  // namespace trammel::cause_search::thresholds
