// SPDX-License-Identifier: Apache-2.0
// The settings table: names, ranges and text forms; "did you mean".
#include <core/nearest_name.h>
#include <core/settings.h>

#include <gtest/gtest.h>

#include <set>

namespace stipple {
namespace {

std::string errorOf(const std::string& key, const std::string& value) {
    RenderSettings settings;
    try {
        applySetting(settings, key, value, "--set");
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
        return error.what();
    }
    return "";
}

TEST(CoreSettings, valueOfEverySettingCanBeSetAgain) {
    std::set<std::string> keys;
    for (const SettingInfo& info : settingsTable()) {
        RenderSettings settings;
        const std::string value = settingValue(settings, info.key);
        ASSERT_FALSE(value.empty()) << info.key;
        applySetting(settings, info.key, value, "");
        EXPECT_EQ(settingValue(settings, info.key), value);
        EXPECT_FALSE(info.help.empty()) << info.key;
        EXPECT_TRUE(keys.insert(info.key).second) << info.key << " is there twice";
    }
}

// Every entry must write the member it reads, and no other.
TEST(CoreSettings, entriesChangeOneValueEach) {
    for (const SettingInfo& info : settingsTable()) {
        const std::string before = settingValue(RenderSettings(), info.key);
        std::string other = before == "2" ? "3" : "2";
        if (before == "on") other = "off";
        if (before == "off") other = "on";
        if (info.key == "method") other = "raycast";
        if (info.key == "sampler") other = "random";
        if (info.key == "reconstruct") other = "gaussian";
        if (info.key == "pull_push_coverage") other = "squares";
        if (info.key == "tone") other = "agx";
        if (info.key == "tile_size") other = "128";
        RenderSettings settings;
        applySetting(settings, info.key, other, "");
        for (const SettingInfo& checked : settingsTable()) {
            const std::string expected =
                checked.key == info.key ? other : settingValue(RenderSettings(), checked.key);
            EXPECT_EQ(settingValue(settings, checked.key), expected)
                << checked.key << " after setting " << info.key;
        }
    }
}

TEST(CoreSettings, refusesWhatIsOutOfRangeOrNoNumber) {
    for (const char* value :
         {"0", "65537", "-1", "", "12px", "1.5", " 12", "1e3", "99999999999999999999"}) {
        EXPECT_NE(errorOf("width", value), "") << value;
    }
    for (const char* value : {"0", "nan", "inf", "-1", "1e400", "1,5", "0x10"}) {
        EXPECT_NE(errorOf("samples", value), "") << value;
    }
    EXPECT_EQ(errorOf("width", "65536"), "");
    EXPECT_EQ(errorOf("samples", "2.5e-1"), "");
    EXPECT_EQ(errorOf("seed", "18446744073709551615"), "");
}

TEST(CoreSettings, errorsNameTheNearestKeyAndTheAllowedValues) {
    EXPECT_EQ(errorOf("sampels", "1"), "--set: unknown setting 'sampels'; did you mean 'samples'?");
    EXPECT_EQ(errorOf("qqqqq", "1"), "--set: unknown setting 'qqqqq'");
    EXPECT_EQ(errorOf("method", "magic"),
              "--set: 'magic' is not a value of method (points|zbuffer|raycast)");
}

TEST(CoreSettings, aFailedChangeLeavesTheSettingsAlone) {
    RenderSettings settings;
    EXPECT_THROW(applySetting(settings, "width", "70000", ""), Error);
    EXPECT_EQ(settings.width, RenderSettings().width);
}

TEST(CoreSettings, cacheCanBeSwitchedOff) {
    RenderSettings settings;
    applySetting(settings, "cache_mb", "off", "");
    EXPECT_EQ(settings.cache_mb, 0);
}

TEST(CoreNearestName, findsTransposedMissingAndAddedLetters) {
    const std::vector<std::string> names = {"width", "height", "samples"};
    EXPECT_EQ(nearestName("wdith", names), "width");
    EXPECT_EQ(nearestName("heigt", names), "height");
    EXPECT_EQ(nearestName("sampless", names), "samples");
    EXPECT_EQ(nearestName("colour", names), "");
    EXPECT_EQ(nearestName("", names), "");
    EXPECT_EQ(nearestName("width", {}), "");
    EXPECT_EQ(nearestName(std::string(1000000, 'w'), names), "");
}

}  // namespace
}  // namespace stipple
