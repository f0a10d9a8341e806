// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/picture.h>

#include <scenegraph/io/json.h>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

namespace stipple {

namespace {

constexpr int kMaxSide = 32768;  // pixels

// OpenImageIO's name of the format, by the file's first bytes. The formats of glTF only: every
// further decoder would be one more way in for a damaged file.
const char* formatOf(const std::string& bytes) {
    if (bytes.starts_with("\x89PNG\r\n\x1a\n")) return "png";
    if (bytes.starts_with("\xff\xd8\xff")) return "jpeg";
    if (bytes.starts_with("RIFF") && bytes.compare(8, 4, "WEBP") == 0) return "webp";
    return nullptr;
}

}  // namespace

Texture::Level decodePicture(const std::string& bytes, const MemoryBudget& budget,
                             const std::string& where) {
    if (bytes.size() < 12)
        throw Error(ErrorCode::kParse, where,
                    "not a picture: only " + std::to_string(bytes.size()) + " bytes");
    const char* format = formatOf(bytes);
    if (!format) throw Error(ErrorCode::kUnsupported, where, "not a PNG, JPEG or WebP picture");
    const auto fail = [&](const std::string& reason) {
        throw Error(ErrorCode::kParse, where,
                    std::string("damaged ") + format + " picture: " + oneLine(reason));
    };

    OIIO::Filesystem::IOMemReader memory(const_cast<char*>(bytes.data()), bytes.size());
    const auto input = OIIO::ImageInput::create(format);
    if (!input || !input->set_ioproxy(&memory)) {
        throw Error(ErrorCode::kUnsupported, where,
                    std::string("OpenImageIO cannot read ") + format + " from memory");
    }
    OIIO::ImageSpec spec, hints;
    hints["oiio:UnassociatedAlpha"] = 1;  // colours are not multiplied with alpha, as glTF has it
    if (!input->open(std::string("picture.") + format, spec, hints)) fail(input->geterror());
    if (spec.width < 1 || spec.height < 1 || spec.width > kMaxSide || spec.height > kMaxSide ||
        spec.nchannels < 1 || spec.nchannels > 16) {
        fail(std::to_string(spec.width) + " x " + std::to_string(spec.height) +
             " pixels are too many or none");
    }
    const size_t n_pixels = size_t(spec.width) * spec.height;
    const int n_channels = spec.nchannels;
    budget.require(double(n_pixels) * (4 + n_channels), where,
                   std::to_string(n_pixels) + " pixels");
    std::vector<uint8_t> raw(n_pixels * n_channels);
    if (!input->read_image(0, 0, 0, n_channels, OIIO::TypeDesc::UINT8, raw.data()))
        fail(input->geterror());

    // 1: grey, 2: grey and alpha, 3: RGB, 4 and more: RGBA.
    Texture::Level level{spec.width, spec.height, std::vector<uint8_t>(n_pixels * 4)};
    const bool is_grey = n_channels < 3, has_alpha = n_channels == 2 || n_channels >= 4;
    for (size_t i = 0; i < n_pixels; ++i) {
        const uint8_t* from = raw.data() + i * n_channels;
        uint8_t* to = level.rgba.data() + i * 4;
        for (int c = 0; c < 3; ++c) to[c] = from[is_grey ? 0 : c];
        to[3] = has_alpha ? from[is_grey ? 1 : 3] : 255;
    }
    return level;
}

std::string encodePng(const Texture::Level& level) {
    const auto output = OIIO::ImageOutput::create("png");
    std::vector<unsigned char> bytes;
    OIIO::Filesystem::IOVecOutput memory(bytes);
    OIIO::ImageSpec spec(level.width, level.height, 4, OIIO::TypeDesc::UINT8);
    spec.attribute("oiio:UnassociatedAlpha", 1);
    if (!output || !output->set_ioproxy(&memory) || !output->open("texture.png", spec) ||
        !output->write_image(OIIO::TypeDesc::UINT8, level.rgba.data()) || !output->close()) {
        throw Error(ErrorCode::kInternal, "",
                    "a texture cannot be encoded as PNG: " +
                        (output ? oneLine(output->geterror()) : "OpenImageIO has no PNG"));
    }
    return std::string(bytes.begin(), bytes.end());
}

Texture readTexture(const std::filesystem::path& file, bool is_srgb, bool is_opaque,
                    LoadContext& context, const std::string& where) {
    Texture texture;
    texture.name = oneLine(file.filename().string());
    texture.srgb = is_srgb;
    texture.levels.push_back(
        decodePicture(readFile(file, context.budget, where), context.budget, where));
    std::vector<uint8_t>& rgba = texture.levels[0].rgba;
    context.budget.take(double(rgba.size()) * 3.0, where, "the texture's texels");
    if (is_opaque) {
        for (size_t i = 3; i < rgba.size(); i += 4) rgba[i] = 255;
    }
    buildMipmaps(texture);
    return texture;
}

int addTexture(Scene& scene, const std::filesystem::path& file, bool is_srgb, bool is_opaque,
               LoadContext& context, const std::string& where) {
    scene.textures.push_back(readTexture(file, is_srgb, is_opaque, context, where));
    return int(scene.textures.size()) - 1;
}

}  // namespace stipple
