"""Settings in, the app out."""

from fastapi import FastAPI

from service_kit.settings import BadSetting, revealed
from services.carla_world.app import build_app
from services.carla_world.client import CarlaClient, Server
from services.carla_world.episodes import CarlaEpisodes
from services.carla_world.scene_documents import SceneDocuments
from services.carla_world.settings import CarlaWorldSettings


def bootstrap(settings: CarlaWorldSettings) -> FastAPI:
    """The app; CARLA itself is asked when somebody asks for it. Raises BadSetting."""
    server = server_of(settings)
    episodes = CarlaEpisodes(
        CarlaClient(server, settings.carla_settle_ticks),
        SceneDocuments(settings.carla_scenes),
        settings.carla_world_lease_s,
        settings.carla_world_max_lease_s,
    )
    return build_app(episodes, str(server), revealed(settings.carla_world_token))


def server_of(settings: CarlaWorldSettings) -> Server:
    """Raises BadSetting."""
    host, _, port = settings.carla.rpartition(":")
    if not host or not port.isdecimal() or not 1 <= int(port) <= 65534:
        raise BadSetting(f"CARLA={settings.carla}: give host:port, such as 127.0.0.1:2000")
    return Server(host, int(port), settings.carla_timeout_s, settings.carla_load_timeout_s, settings.carla_tick_s)
