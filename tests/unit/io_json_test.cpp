// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <scenegraph/io/json.h>

namespace stipple {
namespace {

std::string parseError(const std::string& text) {
    try {
        parseJson(text, "f");
    } catch (const Error& e) {
        EXPECT_EQ(e.code(), ErrorCode::kParse);
        return e.what();
    }
    return "";
}

TEST(IoJson, readsAllKindsOfValues) {
    const Json j = parseJson(R"({"a": [1, -2, 2.5, true, null, "x\u00e9"], "b": {"c": {}}})", "f");
    EXPECT_EQ(j, Json::parse(R"({"a": [1, -2, 2.5, true, null, "x\u00e9"], "b": {"c": {}}})"));
    EXPECT_TRUE(j["a"][0].is_number_unsigned());
}

TEST(IoJson, namesLineAndColumnOfASyntaxError) {
    EXPECT_TRUE(parseError("{\n  \"a\": 1,\n  \"b\" 2\n}")
                    .starts_with("f: line 3, column 7: not valid JSON: syntax error"));
    EXPECT_TRUE(parseError("").starts_with("f: line 1, column 1: "));
    EXPECT_NE(parseError("[1e999]").find("overflow"), std::string::npos);
    EXPECT_NE(parseError("{} x"), "");
}

TEST(IoJson, refusesKeysThatStandTwice) {
    EXPECT_EQ(parseError(R"({"assets": {"oak": 1, "oak": 2}})"),
              "f: not valid JSON: key \"oak\" stands twice in /assets");
}

TEST(IoJson, refusesDeepNestingWithoutOverflowingTheStack) {
    EXPECT_NE(parseError(std::string(1000000, '[')).find("levels deep"), std::string::npos);
    EXPECT_EQ(parseError(std::string(64, '[') + std::string(64, ']')), "");
}

TEST(IoJson, errorsStayOneLine) {
    const std::string error = parseError("{\"a\": \"line\nbreak\"}");
    EXPECT_NE(error, "");
    EXPECT_EQ(error.find('\n'), std::string::npos);
    EXPECT_EQ(oneLine("a\nb\tc\x01"
                      "d"),
              "a b c d");
    EXPECT_EQ(oneLine("\xc3\xa9\xc3\xa9", 3), "\xc3\xa9...");  // no half characters
}

TEST(IoJson, pathsAreWrittenAsPointersAndAsGltfPaths) {
    EXPECT_EQ(jsonPointer({"assets", "a/b~c", "0"}), "/assets/a~1b~0c/0");
    EXPECT_EQ(jsonPointer({}), "/");
    EXPECT_EQ(gltfPath({"meshes", "0", "primitives", "12"}), "meshes[0].primitives[12]");
}

TEST(IoJson, schemaProblemsNameTheInnermostPlace) {
    const JsonSchema schema(R"({
        "type": "object", "additionalProperties": false,
        "definitions": {"kind": {"enum": ["oak", "pine"]}},
        "properties": {"list": {"type": "array", "items": {"type": "object", "properties": {
            "n": {"type": "number", "minimum": 0}, "kind": {"$ref": "#/definitions/kind"}}}}}})");
    EXPECT_FALSE(schema.firstProblem(Json::parse(R"({"list": [{"n": 1, "kind": "oak"}]})")));

    auto problem = schema.firstProblem(Json::parse(R"({"list": [{}, {"n": -1}]})"));
    ASSERT_TRUE(problem);
    EXPECT_EQ(jsonPointer(problem->path), "/list/1/n");
    EXPECT_NE(problem->message.find("got -1"), std::string::npos);

    problem = schema.firstProblem(Json::parse(R"({"list": [{"kind": "elm"}]})"));
    ASSERT_TRUE(problem);
    EXPECT_EQ(problem->message, "\"elm\" is none of \"oak\", \"pine\"");

    problem = schema.firstProblem(Json::parse(R"({"lists": []})"));
    ASSERT_TRUE(problem);
    EXPECT_EQ(problem->message, "unknown key \"lists\"; did you mean \"list\"?");
    problem = schema.firstProblem(Json::parse(R"({"colour": []})"));
    ASSERT_TRUE(problem);
    EXPECT_EQ(problem->message, "unknown key \"colour\"; known: \"list\"");
}

}  // namespace
}  // namespace stipple
