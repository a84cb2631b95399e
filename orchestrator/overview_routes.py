"""What the pages ask beside the deliveries: the overview, the drones, the streets, the order form."""

from fastapi import FastAPI
from fastapi.responses import Response

from contracts.overview import DroneSeen, OrderOptions, Overview, Reading, ReadingQuestion, StreetPlan, Tracking
from orchestrator.order_form import OrderForm
from orchestrator.overview import Overlook
from orchestrator.shared_answers import ChosenLines, file_answer
from service_kit.errors import BadQuestion, NotFound, Unavailable, error_answers

_NOT_FOUND = error_answers(NotFound)


def add_overview_routes(app: FastAPI, overlook: Overlook, form: OrderForm) -> None:
    """Nothing here changes a delivery."""

    @app.get("/v1/overview", tags=["viewer"], responses=_NOT_FOUND)
    async def get_overview(chosen: ChosenLines) -> Overview:
        """Everything at a glance: counts, the newest deliveries of that status, outcome or text, drones, vehicles."""
        return await overlook.overview(chosen)

    @app.get("/v1/deliveries/{delivery_id}/drone", tags=["viewer"], responses=error_answers(NotFound, Unavailable))
    async def get_drone(delivery_id: str) -> DroneSeen:
        """The drone of a delivery in the air, as it tells itself."""
        return await overlook.drone(delivery_id)

    @app.get("/v1/deliveries/{delivery_id}/street", tags=["viewer"], responses=_NOT_FOUND)
    async def get_street(delivery_id: str) -> StreetPlan:
        """The street of a delivery from above."""
        return await overlook.street(delivery_id)

    @app.get("/v1/deliveries/{delivery_id}/tracking", tags=["viewer"], responses=_NOT_FOUND)
    async def get_tracking(delivery_id: str) -> Tracking:
        """What the customer of a delivery is shown."""
        return await overlook.tracking(delivery_id)

    @app.get("/v1/deliveries/{delivery_id}/tracking/street", tags=["viewer"], responses=_NOT_FOUND)
    async def get_customers_street(delivery_id: str) -> StreetPlan:
        """The street of a delivery from above, for its customer."""
        return await overlook.street(delivery_id)

    @app.get(
        "/v1/deliveries/{delivery_id}/tracking/picture",
        tags=["viewer"],
        response_class=Response,
        responses=_NOT_FOUND,
    )
    async def get_customers_picture(delivery_id: str) -> Response:
        """The picture of the stop."""
        return file_answer(await overlook.picture(delivery_id))

    @app.get("/v1/order-options", tags=["viewer"])
    async def get_options() -> OrderOptions:
        """What a delivery may be given beside its request."""
        return await form.options()

    @app.post("/v1/readings", tags=["viewer"], responses=error_answers(BadQuestion, Unavailable))
    async def read_request(question: ReadingQuestion) -> Reading:
        """How a request would be understood, and what a delivery would ask; nothing is ordered."""
        return await form.reading(question)
