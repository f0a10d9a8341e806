// SPDX-License-Identifier: Apache-2.0
#include <core/image.h>
#include <scenegraph/io/number_picture.h>
#include <scenegraph/io/scene_reader.h>

namespace stipple {

namespace {

void readPointLight(SceneReader& reader, const Json& source, const JsonPath& path, bool is_spot) {
    PointLight light;
    readVector(source, "position", light.position);
    readVector(source, "intensity", light.intensity);
    readMember(source, "range", light.range);
    light.is_spot = is_spot;
    if (is_spot) {
        light.axis = Vec3(readDirection(reader, source, light.position, path));
        readDegrees(source, "inner_cone", light.inner_cone);
        readDegrees(source, "outer_cone", light.outer_cone);
        if (!(light.inner_cone < light.outer_cone))
            reader.fail(path, "inner_cone is not less than outer_cone");
    }
    reader.scene.lighting.points.push_back(light);
}

void readLights(SceneReader& reader, const Json& lights) {
    const auto forEach = [&](const char* key, const auto& read) {
        const auto list = lights.find(key);
        if (list == lights.end()) return;
        for (size_t i = 0; i < list->size(); ++i)
            read((*list)[i], JsonPath{"lights", key, std::to_string(i)});
    };
    forEach("suns", [&](const Json& source, const JsonPath& path) {
        Sun sun;
        DVec3 direction(0);
        readVector(source, "direction", direction);
        sun.direction_to_light = Vec3(unitVector(reader, direction, joined(path, {"direction"})));
        readVector(source, "irradiance", sun.irradiance);
        reader.scene.lighting.suns.push_back(sun);
    });
    forEach("points", [&](const Json& source, const JsonPath& path) {
        readPointLight(reader, source, path, false);
    });
    forEach("spots", [&](const Json& source, const JsonPath& path) {
        readPointLight(reader, source, path, true);
    });
}

std::shared_ptr<const Environment> readEnvironment(SceneReader& reader, const Json& source) {
    const JsonPath path = {"background", "environment"};
    const std::string where = reader.where(joined(path, {"file"}));
    const NumberPicture picture = readNumberPicture(
        reader.file(source["file"], joined(path, {"file"})), reader.context.budget, where);
    auto environment = std::make_shared<Environment>();
    environment->width = picture.width, environment->height = picture.height;
    readDegrees(source, "turn", environment->turn);
    float brightness = 1.0f;
    readMember(source, "brightness", brightness);
    const size_t n = size_t(picture.width) * size_t(picture.height);
    reader.context.budget.take(double(n) * sizeof(Vec3), where, "the environment's pixels");
    environment->radiance.resize(n);
    constexpr float kMost = 65504.0f;  // of a half float: pictures of the sun hold infinity
    for (size_t i = 0; i < n; ++i) {
        for (int c = 0; c < 3; ++c) {
            const float value =
                picture
                    .values[i * size_t(picture.channels) + size_t(picture.channels == 3 ? c : 0)];
            const float linear = picture.is_float ? value : linearFromSrgb(value);
            // (Not a number becomes 0.)
            environment->radiance[i][c] =
                linear > 0.0f ? std::min(linear, kMost) * brightness : 0.0f;
        }
    }
    prepareEnvironment(*environment);
    return environment;
}

}  // namespace

void readLighting(SceneReader& reader, const Json& root) {
    Lighting& lighting = reader.scene.lighting;
    readMember(root, "exposure", lighting.exposure);
    if (const auto sky = root.find("background"); sky != root.end()) {
        if (const auto source = sky->find("environment"); source != sky->end()) {
            lighting.sky.environment = readEnvironment(reader, *source);
            lighting.sky.horizon = lighting.sky.environment->horizon;
        }
        readVector(*sky, "zenith", lighting.sky.zenith);
        readVector(*sky, "horizon", lighting.sky.horizon);
        readVector(*sky, "ground", lighting.sky.ground);
        readMember(*sky, "haze_distance", lighting.sky.haze_distance);
    }
    if (const auto lights = root.find("lights"); lights != root.end()) {
        readLights(reader, *lights);
    } else if (!lighting.sky.environment) {  // which has its own sun
        Sun sun;
        sun.direction_to_light = glm::normalize(sun.direction_to_light);
        lighting.suns.push_back(sun);
    }
}

}  // namespace stipple
