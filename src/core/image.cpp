// SPDX-License-Identifier: Apache-2.0
// Pictures are encoded in memory and written by saveFile(), so there is one way by which files
// appear whole or not at all.
#include <core/image.h>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>

namespace stipple {

namespace {

constexpr int64_t kMaxValues = int64_t(1)
                               << 31;  // floats in a picture: 8 GiB; files may claim any size

std::string lowerExtension(const std::string& path) {
    std::string e = std::filesystem::path(path).extension().string();
    std::transform(e.begin(), e.end(), e.begin(),
                   [](unsigned char c) { return char(std::tolower(c)); });
    return e;
}

std::string oneLine(std::string message) {
    while (!message.empty() && std::isspace(static_cast<unsigned char>(message.back())))
        message.pop_back();
    std::replace(message.begin(), message.end(), '\n', ' ');
    return message.empty() ? "unknown reason" : message;
}

Error ioError(const std::string& path, const std::string& message) {
    return Error(ErrorCode::kIo, path, message);
}

uint8_t byteFromUnit(float v) { return uint8_t(std::clamp(v, 0.0f, 1.0f) * 255.0f + 0.5f); }

std::vector<unsigned char> encode(const std::string& path, const OIIO::ImageSpec& spec,
                                  OIIO::TypeDesc type, const void* pixels) {
    const std::unique_ptr<OIIO::ImageOutput> out = OIIO::ImageOutput::create(path);
    if (!out) throw ioError(path, oneLine(OIIO::geterror()));
    std::vector<unsigned char> bytes;
    OIIO::Filesystem::IOVecOutput memory(bytes);
    if (!out->set_ioproxy(&memory) || !out->open(path, spec) || !out->write_image(type, pixels) ||
        !out->close()) {
        throw ioError(path, oneLine(out->geterror()));
    }
    return bytes;
}

std::vector<unsigned char> encodePng(const Image& image, const std::string& path,
                                     const std::map<std::string, std::string>& metadata) {
    const int alpha = image.channelIndex("A");
    const int n_out = alpha >= 0 ? 4 : 3;
    if (image.channelCount() < 3)
        throw Error(ErrorCode::kInvalidArgument, path, "a PNG file needs three channels");
    std::vector<uint8_t> bytes(size_t(image.width) * image.height * n_out);
    const size_t n = size_t(image.width) * image.height;
    for (size_t i = 0; i < n; ++i) {
        const float* p = image.data.data() + i * image.channels.size();
        uint8_t* out = bytes.data() + i * n_out;
        // Pictures are premultiplied, PNG is not.
        const float a = alpha >= 0 ? p[alpha] : 1.0f;
        for (int c = 0; c < 3; ++c)
            out[c] = byteFromUnit(srgbFromLinear(a > 0.0f ? p[c] / a : 0.0f));
        if (alpha >= 0) out[3] = a > 0.0f ? byteFromUnit(a) : 0;
    }
    OIIO::ImageSpec spec(image.width, image.height, n_out, OIIO::TypeDesc::UINT8);
    spec.attribute("oiio:ColorSpace", "sRGB");
    spec.attribute("oiio:UnassociatedAlpha", 1);
    for (const auto& [key, value] : metadata) spec.attribute(key, value);
    return encode(path, spec, OIIO::TypeDesc::UINT8, bytes.data());
}

std::vector<unsigned char> encodeExr(const Image& image, const std::string& path,
                                     const std::map<std::string, std::string>& metadata) {
    OIIO::ImageSpec spec(image.width, image.height, image.channelCount(), OIIO::TypeDesc::FLOAT);
    spec.channelnames = image.channels;
    spec.alpha_channel = image.channelIndex("A");
    spec.attribute("compression", "zip");
    spec.attribute("oiio:ColorSpace", "Linear");
    for (const auto& [key, value] : metadata) spec.attribute(key, value);
    return encode(path, spec, OIIO::TypeDesc::FLOAT, image.data.data());
}

// A file descriptor, closed at the end.
struct File {
    int fd = -1;
    explicit File(int f) : fd(f) {}
    ~File() {
        if (fd >= 0) ::close(fd);
    }
    File(const File&) = delete;
    File& operator=(const File&) = delete;
};

// Returns 0 or errno.
int writeAll(int fd, const char* data, size_t size) {
    while (size > 0) {
        const ssize_t n = ::write(fd, data, size);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return errno;
        data += n;
        size -= size_t(n);
    }
    return 0;
}

void saveBytes(const std::string& path, const char* data, size_t size) {
    // A link stays a link: what it points to is replaced.
    std::error_code ignored;
    std::string target = path;
    if (std::filesystem::is_symlink(path, ignored)) {
        const std::filesystem::path resolved = std::filesystem::weakly_canonical(path, ignored);
        if (!ignored) target = resolved.string();
    }
    struct stat status;
    const bool exists = ::stat(target.c_str(), &status) == 0;
    if (exists && S_ISDIR(status.st_mode)) throw ioError(path, "cannot write: is a directory");
    if (exists && !S_ISREG(status.st_mode)) {  // a device or a pipe: nothing to rename
        const File file(::open(target.c_str(), O_WRONLY | O_CLOEXEC));
        const int error = file.fd < 0 ? errno : writeAll(file.fd, data, size);
        if (error != 0) throw ioError(path, std::string("cannot write: ") + std::strerror(error));
        return;
    }
    static std::atomic<unsigned> counter{0};  // names differ between threads
    const std::string temporary =
        target + ".tmp" + std::to_string(::getpid()) + "_" + std::to_string(counter.fetch_add(1));
    int error = 0;
    {
        const File file(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
        if (file.fd < 0) throw ioError(path, std::string("cannot write: ") + std::strerror(errno));
        error = writeAll(file.fd, data, size);
        if (error == 0 && ::fsync(file.fd) != 0)
            error = errno;  // some file systems report a full disk only now
    }
    if (error == 0 && ::rename(temporary.c_str(), target.c_str()) != 0) error = errno;
    if (error != 0) {
        ::unlink(temporary.c_str());
        throw ioError(path, std::string("cannot write: ") + std::strerror(error));
    }
}

}  // namespace

int Image::channelIndex(const std::string& name) const {
    const auto it = std::find(channels.begin(), channels.end(), name);
    return it == channels.end() ? -1 : int(it - channels.begin());
}

float srgbFromLinear(float linear) {
    if (!(linear > 0.0f)) return 0.0f;
    if (linear >= 1.0f) return 1.0f;
    return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1.0f / 2.4f) - 0.055f;
}

float linearFromSrgb(float srgb) {
    if (!(srgb > 0.0f)) return 0.0f;
    if (srgb >= 1.0f) return 1.0f;
    return srgb <= 0.04045f ? srgb / 12.92f : std::pow((srgb + 0.055f) / 1.055f, 2.4f);
}

uint32_t packSrgb8(const Vec3& linear) {
    const auto to8 = [](float v) {
        return uint32_t(srgbFromLinear(std::clamp(v, 0.0f, 1.0f)) * 255.0f + 0.5f);
    };
    return to8(linear.x) | to8(linear.y) << 8 | to8(linear.z) << 16;
}

Vec3 unpackSrgb8(uint32_t packed) {
    static const std::array<float, 256> table = [] {
        std::array<float, 256> t;
        for (size_t i = 0; i < t.size(); ++i) t[i] = linearFromSrgb(float(i) / 255.0f);
        return t;
    }();
    return Vec3(table[packed & 255], table[packed >> 8 & 255], table[packed >> 16 & 255]);
}

Image loadImage(const std::string& path) {
    std::error_code ignored;
    if (!std::filesystem::exists(path, ignored))
        throw Error(ErrorCode::kFileNotFound, path, "no such file");
    if (std::filesystem::is_directory(path, ignored))
        throw Error(ErrorCode::kParse, path, "is a directory");
    OIIO::ImageSpec config;
    config.attribute("oiio:UnassociatedAlpha",
                     1);  // premultiplying is right only after linearizing
    const std::unique_ptr<OIIO::ImageInput> in = OIIO::ImageInput::open(path, &config);
    if (!in) throw Error(ErrorCode::kParse, path, oneLine(OIIO::geterror()));
    const OIIO::ImageSpec& spec = in->spec();
    if (spec.width < 1 || spec.height < 1 || spec.nchannels < 1 || spec.depth > 1 ||
        spec.nchannels > 1024 || int64_t(spec.width) * spec.height > kMaxValues / spec.nchannels) {
        throw Error(ErrorCode::kParse, path,
                    "picture size " + std::to_string(spec.width) + "x" +
                        std::to_string(spec.height) + "x" + std::to_string(spec.depth) + ", " +
                        std::to_string(spec.nchannels) + " channels, is out of range");
    }
    Image image(spec.width, spec.height, spec.channelnames);
    if (!in->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::FLOAT, image.data.data())) {
        throw Error(ErrorCode::kParse, path, oneLine(in->geterror()));
    }
    if (spec.format.is_floating_point()) return image;
    const int alpha = spec.alpha_channel;
    const bool premultiply = alpha >= 0 && spec.get_int_attribute("oiio:UnassociatedAlpha", 0) != 0;
    for (size_t i = 0; i < image.data.size(); i += size_t(spec.nchannels)) {
        float* p = image.data.data() + i;
        for (int c = 0; c < spec.nchannels; ++c) {
            if (c != alpha) p[c] = linearFromSrgb(p[c]) * (premultiply ? p[alpha] : 1.0f);
        }
    }
    return image;
}

void saveImage(const Image& image, const std::string& path,
               const std::map<std::string, std::string>& metadata) {
    if (image.width < 1 || image.height < 1 || image.channels.empty() ||
        image.data.size() != size_t(image.width) * image.height * image.channels.size()) {
        throw Error(ErrorCode::kInvalidArgument, path, "the picture is empty");
    }
    const std::string extension = lowerExtension(path);
    std::vector<unsigned char> bytes;
    if (extension == ".png") {
        bytes = encodePng(image, path, metadata);
    } else if (extension == ".exr") {
        bytes = encodeExr(image, path, metadata);
    } else {
        throw Error(ErrorCode::kInvalidArgument, path, "pictures are written as .png or .exr");
    }
    saveBytes(path, reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

void saveFile(const std::string& path, const std::string& contents) {
    saveBytes(path, contents.data(), contents.size());
}

}  // namespace stipple
