#include "server/report/html.h"

#include <gtest/gtest.h>

namespace trammel {
namespace {

TEST(Html, TextStaysText) { EXPECT_EQ(html_text("<b> & \"x\""), "&lt;b&gt; &amp; &quot;x&quot;"); }

TEST(Html, ARowHasACellForEachText) {
  EXPECT_EQ(html_row({"a", "b"}), "<tr><td>a</td><td>b</td></tr>\n");
  EXPECT_EQ(html_row({"a"}, "th"), "<tr><th>a</th></tr>\n");
}

TEST(Html, APageIsFilledInOnceAndContentsAreNotReadAgain) {
  EXPECT_EQ(fill_in("{{a}} and {{b}}, {{a}}", {{"a", "{{b}}"}, {"b", "2"}}), "{{b}} and 2, {{b}}");
  EXPECT_EQ(fill_in("nothing", {}), "nothing");
}

TEST(HtmlDeathTest, ANameWithoutContentIsABug) { EXPECT_DEATH((void)fill_in("{{a}}", {}), "content"); }

TEST(ShownValue, IsRoundedToTwoDigitsOfItsUncertainty) {
  const auto shown = [](double value, double expanded) {
    const ShownValue text = show_with_uncertainty(value, expanded);
    return text.value + " +- " + text.expanded;
  };
  EXPECT_EQ(shown(0.498731, 0.00213), "0.4987 +- 0.0021");
  EXPECT_EQ(shown(812.4, 183.2), "810 +- 180");
  EXPECT_EQ(shown(-12.34567, 0.51), "-12.35 +- 0.51");
  EXPECT_EQ(shown(1.698e-3, 1.23e-5), "1.698e-03 +- 1.2e-05");
  EXPECT_EQ(shown(2.8e-10, 3.1e-12), "2.800e-10 +- 3.1e-12");
  EXPECT_EQ(shown(0, 1e-9), "0.0e+00 +- 1.0e-09");
  EXPECT_EQ(shown(1e-12, 1e-9), "1e-12 +- 1.0e-09");
  EXPECT_EQ(shown(1234, 56), "1234 +- 56");
  EXPECT_EQ(shown(1.25, 0), "1.25 +- 0");
}

}  // namespace
}  // namespace trammel
