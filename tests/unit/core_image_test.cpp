// SPDX-License-Identifier: Apache-2.0
// Pictures to and from files: values, names, and what is left when something goes wrong.
#include <core/image.h>

#include <gtest/gtest.h>

#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace stipple {
namespace {

namespace fs = std::filesystem;

// A folder of its own for every test, removed at the end.
class CoreImage : public ::testing::Test {
protected:
    void SetUp() override {
        folder_ = fs::temp_directory_path() /
                  ("stipple_image_" + std::to_string(::getpid()) + "_" +
                   ::testing::UnitTest::GetInstance()->current_test_info()->name());
        fs::create_directories(folder_);
    }
    void TearDown() override { fs::remove_all(folder_); }

    std::string path(const std::string& name) const { return (folder_ / name).string(); }
    size_t fileCount() const {
        return size_t(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
    }

    fs::path folder_;
};

std::string contentsOf(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
}

ErrorCode codeOf(const std::function<void()>& action, std::string* message = nullptr) {
    try {
        action();
    } catch (const Error& e) {
        if (message) *message = e.what();
        return e.code();
    }
    ADD_FAILURE() << "nothing was thrown";
    return ErrorCode::kInternal;
}

Image gradient(int width, int height, std::vector<std::string> channels) {
    Image image(width, height, std::move(channels));
    for (size_t i = 0; i < image.data.size(); ++i) image.data[i] = float(i % 97) / 96.0f;
    return image;
}

TEST_F(CoreImage, srgbAndLinearAreInverse) {
    for (int i = 0; i <= 1000; ++i) {
        const float v = float(i) / 1000.0f;
        EXPECT_NEAR(linearFromSrgb(srgbFromLinear(v)), v, 2e-6f);
    }
    EXPECT_NEAR(srgbFromLinear(0.5f), 0.735357f, 1e-5f);
    EXPECT_EQ(srgbFromLinear(-1.0f), 0.0f);
    EXPECT_EQ(srgbFromLinear(7.0f), 1.0f);
    EXPECT_EQ(srgbFromLinear(std::numeric_limits<float>::quiet_NaN()), 0.0f);
}

TEST_F(CoreImage, pngKeepsEveryByteValue) {
    Image image(256, 2, {"R", "G", "B"});
    for (int x = 0; x < 256; ++x) {
        for (int c = 0; c < 3; ++c) image.pixel(x, 0)[c] = linearFromSrgb(float(x) / 255.0f);
        image.pixel(x, 1)[0] = 2.0f;  // clipped
    }
    saveImage(image, path("a.png"));
    const Image read = loadImage(path("a.png"));
    ASSERT_EQ(read.width, 256);
    ASSERT_EQ(read.height, 2);
    EXPECT_EQ(read.channels, (std::vector<std::string>{"R", "G", "B"}));
    for (int x = 0; x < 256; ++x) {
        EXPECT_NEAR(read.pixel(x, 0)[1], image.pixel(x, 0)[1], 1e-6f);
        EXPECT_EQ(read.pixel(x, 1)[0], 1.0f);
        EXPECT_EQ(read.pixel(x, 1)[1], 0.0f);
    }
}

TEST_F(CoreImage, pngOfPremultipliedColourComesBackPremultiplied) {
    Image image(3, 1, {"R", "G", "B", "A"});
    const float pixels[3][4] = {
        {0.25f, 0.1f, 0.0f, 0.5f}, {0.0f, 0.0f, 0.0f, 0.0f}, {0.3f, 0.6f, 0.9f, 1.0f}};
    for (int x = 0; x < 3; ++x) std::copy_n(pixels[x], 4, image.pixel(x, 0));
    saveImage(image, path("a.png"));
    const Image read = loadImage(path("a.png"));
    ASSERT_EQ(read.channelIndex("A"), 3);
    for (int x = 0; x < 3; ++x) {
        for (int c = 0; c < 4; ++c)
            EXPECT_NEAR(read.pixel(x, 0)[c], pixels[x][c], 0.006f) << x << " " << c;
    }
}

TEST_F(CoreImage, exrKeepsEveryChannelAndTheMetadata) {
    Image image = gradient(7, 5, {"R", "G", "B", "A", "depth", "normal.X", "coverage"});
    image.pixel(3, 2)[4] = std::numeric_limits<float>::infinity();
    image.pixel(4, 2)[0] = -3.5e20f;
    saveImage(image, path("a.exr"), {{"stipple:seed", "4711"}});
    const Image read = loadImage(path("a.exr"));
    ASSERT_EQ(read.channelCount(), image.channelCount());
    for (int c = 0; c < image.channelCount(); ++c) {
        const int d = read.channelIndex(image.channels[c]);
        ASSERT_GE(d, 0) << image.channels[c];
        for (int y = 0; y < 5; ++y) {
            for (int x = 0; x < 7; ++x) EXPECT_EQ(read.pixel(x, y)[d], image.pixel(x, y)[c]);
        }
    }
    const std::string bytes = contentsOf(path("a.exr"));
    EXPECT_NE(bytes.find("stipple:seed"), std::string::npos);
    EXPECT_NE(bytes.find("4711"), std::string::npos);
}

TEST_F(CoreImage, unreadableFilesAreErrorsThatNameThem) {
    EXPECT_EQ(codeOf([&] { loadImage(path("none.png")); }), ErrorCode::kFileNotFound);
    EXPECT_EQ(codeOf([&] { loadImage(folder_.string()); }), ErrorCode::kParse);
    std::ofstream(path("text.png")) << "this is no picture";
    std::string message;
    EXPECT_EQ(codeOf([&] { loadImage(path("text.png")); }, &message), ErrorCode::kParse);
    EXPECT_EQ(message.find(path("text.png")), 0u);
    EXPECT_EQ(message.find('\n'), std::string::npos);
}

TEST_F(CoreImage, everyPrefixOfAFileIsAnErrorOrAPicture) {
    for (const std::string name : {"a.png", "a.exr"}) {
        saveImage(gradient(31, 17, {"R", "G", "B"}), path(name));
        const std::string whole = contentsOf(path(name));
        for (size_t n = 0; n < whole.size(); n += 7) {
            std::ofstream(path("cut_" + name), std::ios::binary)
                .write(whole.data(), std::streamsize(n));
            try {
                loadImage(path("cut_" + name));
                EXPECT_GT(n, whole.size() / 2) << name;
            } catch (const Error& e) {
                EXPECT_EQ(e.code(), ErrorCode::kParse);
            }
        }
    }
}

TEST_F(CoreImage, otherExtensionsAndEmptyPicturesAreRefused) {
    const Image image = gradient(4, 4, {"R", "G", "B"});
    EXPECT_EQ(codeOf([&] { saveImage(image, path("a.bmp")); }), ErrorCode::kInvalidArgument);
    EXPECT_EQ(codeOf([&] { saveImage(image, path("png")); }), ErrorCode::kInvalidArgument);
    EXPECT_EQ(codeOf([&] { saveImage(Image(), path("a.png")); }), ErrorCode::kInvalidArgument);
    EXPECT_EQ(codeOf([&] { saveImage(gradient(4, 4, {"depth"}), path("a.png")); }),
              ErrorCode::kInvalidArgument);
    EXPECT_EQ(fileCount(), 0u);
}

TEST_F(CoreImage, failedWritesGiveTheReasonAndLeaveNothing) {
    std::string message;
    EXPECT_EQ(codeOf([&] { saveFile(path("no/such/folder/a.json"), "{}"); }, &message),
              ErrorCode::kIo);
    EXPECT_NE(message.find("No such file or directory"), std::string::npos) << message;
    fs::create_directory(folder_ / "a.exr");
    EXPECT_EQ(codeOf([&] { saveImage(gradient(4, 4, {"R"}), path("a.exr")); }), ErrorCode::kIo);
    EXPECT_EQ(fileCount(), 1u);
}

TEST_F(CoreImage, fullDiskIsAnError) {
    if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
    std::string message;
    EXPECT_EQ(codeOf([&] { saveFile("/dev/full", "contents"); }, &message), ErrorCode::kIo);
    EXPECT_NE(message.find("No space left on device"), std::string::npos) << message;
    EXPECT_TRUE(fs::is_character_file("/dev/full"));
}

TEST_F(CoreImage, writeThatFailsHalfwayKeepsTheOldFile) {
    saveFile(path("a.txt"), "old");
    rlimit old_limit;
    ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &old_limit), 0);
    const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
    rlimit small = old_limit;
    small.rlim_cur = 4096;
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
    std::string message;
    const ErrorCode code =
        codeOf([&] { saveFile(path("a.txt"), std::string(10000, 'x')); }, &message);
    ::setrlimit(RLIMIT_FSIZE, &old_limit);
    std::signal(SIGXFSZ, old_handler);
    EXPECT_EQ(code, ErrorCode::kIo);
    EXPECT_EQ(contentsOf(path("a.txt")), "old");
    EXPECT_EQ(fileCount(), 1u);
}

TEST_F(CoreImage, savingReplacesAFileAndKeepsALink) {
    saveFile(path("target.txt"), "old");
    fs::create_symlink("target.txt", folder_ / "link.txt");
    saveFile(path("link.txt"), "new");
    EXPECT_TRUE(fs::is_symlink(folder_ / "link.txt"));
    EXPECT_EQ(contentsOf(path("target.txt")), "new");
    EXPECT_EQ(fileCount(), 2u);
}

}  // namespace
}  // namespace stipple
